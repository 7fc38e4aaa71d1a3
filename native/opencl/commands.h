// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/token.h"
#include "opencl/buffer.h"
#include "opencl/device.h"

namespace bvhlab::opencl {

/// A kernel with its name, for one thread: its arguments are part of it.
struct Kernel {
    std::string name;
    KernelHandle handle;
    std::size_t largest_group;  ///< work-items that the device can run in one group
};

/// A program's kernels. An object for each call and thread; the program itself is kept by the
/// device.
class Program {
public:
    Program(Device& device, const ProgramSource& source)
        : device_(device), program_(device.program(source)) {}

    /// Throws Error for a name that no kernel has.
    Kernel& operator[](const std::string& name);

private:
    Device& device_;
    cl_program program_;
    std::map<std::string, Kernel> kernels_;
};

/// How many work-items run a kernel: at least `items`, rounded up to whole groups, so a kernel
/// begins with `if (get_global_id(0) >= count) return;`. `group` 0 takes Commands::work_group.
struct Range {
    std::size_t items;
    std::size_t group = 0;

    Range(std::size_t items_, std::size_t group_ = 0)  // NOLINT: a number is a range
        : items(items_), group(group_) {}
};

/// A kernel argument: local memory of so many bytes.
struct Local {
    std::size_t bytes;
};

/// What one kernel took, all of its launches together.
struct KernelTime {
    std::string stage, kernel;
    std::size_t launches = 0;
    double seconds = 0.0;
};

/// What the commands of one call took on the device, by its own clock.
struct Times {
    std::vector<KernelTime> kernels;  ///< in order of first launch
    double transfer_seconds = 0.0;    ///< host to device and back
    std::size_t transfer_bytes = 0;

    double kernel_seconds() const;
    double stage_seconds(const std::string& stage) const;
};

/// One call's queue of commands: they run in order, and times are taken from the events' profiles.
/// For one thread. Each launch checks the token first. Nothing may be assumed to have run before
/// finish() or download().
///
/// Throws Error naming the kernel and the device where a command fails, Cancelled after a cancel.
class Commands {
public:
    Commands(Device& device, const Token& token);
    ~Commands();
    Commands(const Commands&) = delete;
    Commands& operator=(const Commands&) = delete;

    Device& device() { return device_; }
    const Token& token() const { return token_; }

    /// Work-items to a group where a Range does not say; kernels must be right for any from 3 on.
    /// (PoCL crashes over barriers in groups of one or two.)
    std::size_t work_group;

    /// Whether work is shared out as suits a GPU, else as suits the cores and caches of a CPU,
    /// where that differs; results do not. As the device is; tests set it.
    bool suits_gpu;

    /// Whether kernels for which that pays talk by sub-groups; results do not differ. As the device
    /// can; tests clear it.
    bool use_sub_groups;

    /// Names the stage that the launches from now on belong to.
    void stage(const char* name) { stage_ = name; }

    template <class T>
    Buffer<T> buffer(std::size_t count) {
        return Buffer<T>(device_, count);
    }

    template <class T>
    Buffer<std::remove_const_t<T>> upload(std::span<T> values) {
        Buffer<std::remove_const_t<T>> target(device_, values.size());
        write(target.get(), values.data(), values.size_bytes());
        return target;
    }

    /// Writes over the beginning of `target`.
    template <class T>
    void upload(std::span<const T> values, const Buffer<T>& target) {
        write(target.get(), values.data(), values.size_bytes());
    }

    /// Waits for all commands, then copies from the beginning, or from element `first` on.
    template <class T>
    void download(const Buffer<T>& source, std::span<T> values, std::size_t first = 0) {
        read(source.get(), first * sizeof(T), values.data(), values.size_bytes());
    }

    /// One element, waited for.
    template <class T>
    T value(const Buffer<T>& source, std::size_t index) {
        T one;
        download(source, std::span<T>(&one, 1), index);
        return one;
    }

    /// Sets all elements; `T` is a number of 1, 2, 4 or 8 bytes.
    template <class T>
    void fill(const Buffer<T>& target, T value) {
        fill_bytes(target.get(), &value, sizeof(T), target.bytes());
    }

    template <class T>
    void copy(const Buffer<T>& source, const Buffer<T>& target, std::size_t count) {
        copy_bytes(source.get(), target.get(), count * sizeof(T));
    }

    /// Runs a kernel with its arguments: buffers, Local, or numbers and structs by value, each of
    /// exactly the size that the kernel declares. No items, no launch.
    template <class... Arguments>
    void run(Kernel& kernel, Range range, const Arguments&... arguments) {
        if (range.items == 0) return;
        cl_uint index = 0;
        (set_argument(kernel, index++, arguments), ...);
        launch(kernel, range);
    }

    /// Waits for all commands.
    void finish();

    /// Of all commands that were waited for.
    const Times& times() const { return times_; }

private:
    struct Pending {
        EventHandle event;
        std::string stage, name;
        std::size_t transfer_bytes;  ///< 0: a kernel
    };

    template <class T>
    void set_argument(Kernel& kernel, cl_uint index, const Buffer<T>& buffer) {
        const cl_mem memory = buffer.get();
        set_bytes(kernel, index, sizeof(memory), &memory);
    }
    void set_argument(Kernel& kernel, cl_uint index, const Local& local) {
        set_bytes(kernel, index, local.bytes, nullptr);
    }
    template <class T>
    void set_argument(Kernel& kernel, cl_uint index, const T& value) {
        static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
        set_bytes(kernel, index, sizeof(T), &value);
    }

    void set_bytes(Kernel& kernel, cl_uint index, std::size_t size, const void* bytes);
    void launch(Kernel& kernel, const Range& range);
    void write(cl_mem target, const void* bytes, std::size_t size);
    void read(cl_mem source, std::size_t offset, void* bytes, std::size_t size);
    void fill_bytes(cl_mem target, const void* pattern, std::size_t pattern_size, std::size_t size);
    void copy_bytes(cl_mem source, cl_mem target, std::size_t size);
    void note(cl_event event, const std::string& name, std::size_t transfer_bytes);
    void take_times();

    Device& device_;
    const Token& token_;
    QueueHandle queue_;
    std::string stage_;
    std::vector<Pending> pending_;
    Times times_;
};

}  // namespace bvhlab::opencl
