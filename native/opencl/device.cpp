// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/device.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

#include "base/parallel.h"
#include "base/token.h"
#include "opencl/commands.h"
#include "opencl/program.h"

namespace bvhlab::opencl {
namespace {

struct Found {
    DeviceInfo info;
    cl_device_id id = nullptr;
};

/// It has a cache of its own, and compiles each kernel once more when it is asked for a binary.
constexpr const char* pocl = "Portable Computing Language";

std::string trimmed(std::string text) {
    while (!text.empty() && (text.back() == '\0' || text.back() == ' ')) text.pop_back();
    text.erase(0, text.find_first_not_of(' '));
    return text;
}

std::string platform_text(cl_platform_id platform, cl_platform_info what) {
    std::size_t size = 0;
    check(api().GetPlatformInfo(platform, what, 0, nullptr, &size), "clGetPlatformInfo");
    std::string text(size, '\0');
    check(api().GetPlatformInfo(platform, what, size, text.data(), nullptr), "clGetPlatformInfo");
    return trimmed(text);
}

std::string device_text(cl_device_id device, cl_device_info what) {
    std::size_t size = 0;
    check(api().GetDeviceInfo(device, what, 0, nullptr, &size), "clGetDeviceInfo");
    std::string text(size, '\0');
    check(api().GetDeviceInfo(device, what, size, text.data(), nullptr), "clGetDeviceInfo");
    return trimmed(text);
}

template <class Value>
Value device_value(cl_device_id device, cl_device_info what) {
    Value value{};
    check(api().GetDeviceInfo(device, what, sizeof(value), &value, nullptr), "clGetDeviceInfo");
    return value;
}

/// What keeps a device from doing what the kernels need; empty where nothing does.
std::string lack(cl_device_id id) {
    if (!device_value<cl_bool>(id, CL_DEVICE_AVAILABLE))
        return "its driver says that it is not available";
    if (!device_value<cl_bool>(id, CL_DEVICE_COMPILER_AVAILABLE))
        return "its driver has no compiler";
    if (!device_value<cl_bool>(id, CL_DEVICE_ENDIAN_LITTLE)) return "it is big-endian";
    if (device_value<cl_device_fp_config>(id, CL_DEVICE_DOUBLE_FP_CONFIG) == 0)
        return "it has no double precision, by which hits are decided";
    const std::string version = device_text(id, CL_DEVICE_VERSION);
    if (version.starts_with("OpenCL 1.0") || version.starts_with("OpenCL 1.1"))
        return "it has " + version + ", and 1.2 is needed";
    return {};
}

void describe(DeviceInfo& info, cl_device_id id) {
    info.name = device_text(id, CL_DEVICE_NAME);
    info.driver = device_text(id, CL_DRIVER_VERSION);
    info.id = "opencl:" + info.platform + "/" + info.name;
    info.is_gpu = (device_value<cl_device_type>(id, CL_DEVICE_TYPE) & CL_DEVICE_TYPE_GPU) != 0;
    info.memory = device_value<cl_ulong>(id, CL_DEVICE_GLOBAL_MEM_SIZE);
    info.largest_buffer = device_value<cl_ulong>(id, CL_DEVICE_MAX_MEM_ALLOC_SIZE);
    info.local_memory = device_value<cl_ulong>(id, CL_DEVICE_LOCAL_MEM_SIZE);
    info.compute_units = device_value<cl_uint>(id, CL_DEVICE_MAX_COMPUTE_UNITS);
    info.largest_work_group = device_value<std::size_t>(id, CL_DEVICE_MAX_WORK_GROUP_SIZE);
    const std::string extensions = device_text(id, CL_DEVICE_EXTENSIONS) + " ";
    const auto has = [&](const char* name) { return extensions.find(name) != std::string::npos; };
    info.has_long_atomics =
        has("cl_khr_int64_base_atomics ") && has("cl_khr_int64_extended_atomics ");
    info.sub_groups = {.shuffles = has("cl_khr_subgroup_shuffle "),
                       .ballots = has("cl_khr_subgroup_ballot "),
                       .standard = has("cl_khr_subgroups ") ? "CL1.2" : "",
                       .reason = has("cl_khr_subgroups ") ? "they are checked when it is opened"
                                                          : "its driver has no cl_khr_subgroups"};
    info.reason = lack(id);
    info.available = info.reason.empty();
}

void add_devices(cl_platform_id platform, std::vector<Found>& all) {
    Found found;
    found.info.platform = platform_text(platform, CL_PLATFORM_NAME);
    found.info.id = "opencl:" + found.info.platform;
    found.info.name = found.info.platform;
    cl_uint count = 0;
    const cl_int code = api().GetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 0, nullptr, &count);
    if (code == CL_DEVICE_NOT_FOUND || (code == CL_SUCCESS && count == 0)) {
        found.info.reason = "the platform has no devices";
        all.push_back(found);
        return;
    }
    check(code, "clGetDeviceIDs");
    std::vector<cl_device_id> ids(count);
    check(api().GetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, count, ids.data(), nullptr),
          "clGetDeviceIDs");
    for (cl_device_id id : ids) {
        Found device = found;
        device.id = id;
        try {
            describe(device.info, id);
        } catch (const Error& error) {
            device.info.reason = error.what();
        }
        all.push_back(device);
    }
}

/// Appends " #2" and so on to the ids of twins.
void number_twins(std::vector<Found>& all) {
    std::map<std::string, int> seen;
    for (Found& found : all) {
        const int number = ++seen[found.info.id];
        if (number > 1) found.info.id += " #" + std::to_string(number);
    }
}

std::vector<Found> find_devices() {
    std::vector<Found> all;
    const auto left_out = [](const std::string& id, const std::string& reason) {
        Found found;
        found.info.id = id;
        found.info.name = "OpenCL";
        found.info.reason = reason;
        return found;
    };
    try {
        cl_uint count = 0;
        const cl_int code = api().GetPlatformIDs(0, nullptr, &count);
        constexpr cl_int platform_not_found = -1001;
        if (code == platform_not_found || (code == CL_SUCCESS && count == 0))
            return {left_out("opencl", "the OpenCL loader finds no platform; install a driver")};
        check(code, "clGetPlatformIDs");
        std::vector<cl_platform_id> platforms(count);
        check(api().GetPlatformIDs(count, platforms.data(), nullptr), "clGetPlatformIDs");
        for (cl_platform_id platform : platforms) {
            try {
                add_devices(platform, all);
            } catch (const Error& error) {
                all.push_back(left_out("opencl:a platform that does not answer", error.what()));
            }
        }
    } catch (const Error& error) {
        return {left_out("opencl", error.what())};
    }
    number_twins(all);
    return all;
}

/// The device that a name stands for. Throws as Device::open.
const Found& chosen(const std::vector<Found>& all, const std::string& id) {
    const auto usable = [](const Found& found) { return found.info.available; };
    if (id == "opencl") {
        const auto is_usable_gpu = [](const Found& found) {
            return found.info.available && found.info.is_gpu;
        };
        auto found = std::ranges::find_if(all, is_usable_gpu);
        if (found == all.end()) found = std::ranges::find_if(all, usable);
        if (found != all.end()) return *found;
        throw Error("no OpenCL device can be used: " + all.front().info.reason);
    }
    std::string known;
    for (const Found& found : all) {
        if (found.info.id == id) {
            if (usable(found)) return found;
            throw Error("device '" + id + "' cannot be used: " + found.info.reason);
        }
        if (usable(found)) known += ", " + found.info.id;
    }
    throw std::invalid_argument("unknown device '" + id + "'; there are: cpu" + known);
}

}  // namespace

std::vector<DeviceInfo> devices() {
    std::vector<DeviceInfo> infos;
    for (Found& found : find_devices()) infos.push_back(std::move(found.info));
    return infos;
}

std::shared_ptr<Device> Device::open(const std::string& id) {
    // Never closed: drivers may be gone before our static objects are.
    static auto& opened = *new std::map<std::string, std::shared_ptr<Device>>();
    static auto& mutex = *new std::mutex();
    const std::scoped_lock lock(mutex);
    if (const auto found = opened.find(id); found != opened.end()) return found->second;
    const auto all = find_devices();
    const Found& found = chosen(all, id);
    std::shared_ptr<Device>& device = opened[found.info.id];
    if (!device) {
        try {
            device.reset(new Device(found.info, found.id));
            device->check_arithmetic();
            device->check_sub_groups();
        } catch (...) {
            opened.erase(found.info.id);
            throw;
        }
    }
    return device;
}

Device::Device(DeviceInfo info, cl_device_id id) : info_(std::move(info)), id_(id) {
    cl_int code = CL_SUCCESS;
    context_.reset(api().CreateContext(nullptr, 1, &id_, nullptr, nullptr, &code));
    check(code, "no context on device '" + info_.id + "'");
}

cl_program Device::program(const ProgramSource& source) {
    const std::string text = program_text(source);
    const std::scoped_lock lock(mutex_);
    ProgramHandle& program = programs_[text];
    if (!program) {
        const Stopwatch watch;
        try {
            program = build_program(*this, source, info_.platform != pocl);
        } catch (...) {
            programs_.erase(text);
            throw;
        }
        build_seconds_ += watch.seconds();
    }
    return program.get();
}

double Device::build_seconds() const {
    const std::scoped_lock lock(mutex_);
    return build_seconds_;
}

/// Hits are decided by arithmetic that must round as IEEE 754 says, operation by operation. What a
/// driver claims of itself is not enough: a small kernel shows what it does.
void Device::check_arithmetic() {
    Token token;
    Commands commands(*this, token);
    // a * b + c is 2^-24 (2^-54 in double) with one rounding, 0 with two.
    const float a = 1.0F + 0x1p-12F, c = -(1.0F + 0x1p-11F);
    const double da = 1.0 + 0x1p-27, dc = -(1.0 + 0x1p-26);
    const float tiny = 0x1p-130F;
    const auto floats = commands.buffer<float>(4);
    const auto doubles = commands.buffer<double>(4);
    Program program(*this, {{"arithmetic.cl"}, ""});
    commands.run(program["check_arithmetic"], 1, a, c, tiny, da, dc, floats, doubles);
    float f[4];
    double d[4];
    commands.download(floats, std::span<float>(f));
    commands.download(doubles, std::span<double>(d));
    const auto need = [&](bool right, const char* what) {
        if (!right)
            throw Error("device '" + info_.id + "' cannot be used: its driver (" + info_.driver +
                        ") " + what + ", so that hits would not be exact");
    };
    need(f[0] == 0.0F && d[0] == 0.0, "contracts a * b + c though it is told not to");
    need(f[1] == tiny * 0.5F, "takes denormal numbers for zero");
    need(d[1] == 0x1p-54, "has no fused multiply-add for double that rounds once");
    need(d[2] == da / 3.0 && f[2] == float(1.0 / double(a)), "does not round quotients correctly");
    need(f[3] == 3.0F * 0x1p-149F && d[3] == 0x1p-1073,
         "does not convert or add denormal numbers as IEEE 754 says");
}

}  // namespace bvhlab::opencl
