// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "opencl/api.h"

namespace bvhlab::opencl {

/// What a device's sub-groups, the threads that its driver runs in step, are good for. Their size
/// is the driver's affair, and may be another for each kernel.
struct SubGroups {
    bool usable = false;    ///< votes and sums (cl_khr_subgroups), checked; the next two go with it
    bool shuffles = false;  ///< cl_khr_subgroup_shuffle
    bool ballots = false;   ///< cl_khr_subgroup_ballot
    std::string standard;   ///< of OpenCL C, for kernels that use them; empty where it has none
    std::string reason;     ///< why something of them is not used; empty where all is
};

/// A device as its driver describes it, or a platform without one.
struct DeviceInfo {
    std::string id;  ///< "opencl:<platform>/<device>"; twins have " #2" and so on behind it
    std::string name, platform, driver;
    bool available = false;
    std::string reason;  ///< why it is not available
    bool is_gpu = false;
    std::uint64_t memory = 0;          ///< bytes, all of it
    std::uint64_t largest_buffer = 0;  ///< bytes
    std::uint64_t local_memory = 0;    ///< bytes of a work-group
    std::uint32_t compute_units = 0;
    std::size_t largest_work_group = 0;
    bool has_long_atomics = false;  ///< cl_khr_int64_base_atomics and _extended_atomics
    SubGroups sub_groups;
};

/// All devices of all platforms. One entry with id "opencl" says why where there is none. A
/// platform that cannot be asked is an entry with its reason; nothing is thrown.
std::vector<DeviceInfo> devices();

/// The sources of one program: files of kernels/, in order, and build options ("-DWIDTH=8"), in
/// which a scene's features are. common.cl stands before them always.
struct ProgramSource {
    std::vector<std::string> files;
    std::string options;
    bool sub_groups = false;  ///< team.cl is by sub-groups, which the device must have
};

/// An open device with its context and the programs built for it. Kept open once opened. All
/// members may be called from any thread.
class Device {
public:
    /// `id` as in DeviceInfo, or "opencl": the first available device, GPUs before others.
    /// Throws std::invalid_argument listing the devices there are for an unknown id, Error with the
    /// reason for one that cannot be used.
    static std::shared_ptr<Device> open(const std::string& id);

    const DeviceInfo& info() const { return info_; }
    cl_context context() const { return context_.get(); }
    cl_device_id id() const { return id_; }

    /// The program, built at first use: from the cache of binaries in the user's cache folder, else
    /// from its sources. Throws Error with driver and build log where it does not compile.
    cl_program program(const ProgramSource& source);

    /// Threads of a sub-group where a kernel runs in groups of `group`; the last one may have
    /// fewer. 0 where the driver does not say.
    std::size_t sub_group_size(cl_kernel kernel, std::size_t group) const;

    /// Seconds spent building programs so far.
    double build_seconds() const;

    /// Notes that a buffer takes memory, or gives it back. Throws MemoryError where the device has
    /// less than all buffers take.
    void take_memory(std::size_t bytes);
    void give_memory(std::size_t bytes) { memory_taken_ -= bytes; }

private:
    Device(DeviceInfo info, cl_device_id id);
    void check_arithmetic();
    void check_sub_groups();

    DeviceInfo info_;
    cl_device_id id_;
    ContextHandle context_;
    std::atomic<std::size_t> memory_taken_{0};  ///< bytes
    mutable std::mutex mutex_;                  ///< guards what follows
    std::map<std::string, ProgramHandle> programs_;
    double build_seconds_ = 0.0;
};

}  // namespace bvhlab::opencl
