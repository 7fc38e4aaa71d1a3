// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/commands.h"

#include <algorithm>

namespace bvhlab::opencl {
namespace {

/// Commands that may wait in the queue; a cancel has to wait for them too.
constexpr std::size_t most_pending = 64;

double profiled_seconds(cl_event event) {
    cl_ulong start = 0, end = 0;
    check(api().GetEventProfilingInfo(event, CL_PROFILING_COMMAND_START, sizeof(start), &start,
                                      nullptr),
          "clGetEventProfilingInfo");
    check(api().GetEventProfilingInfo(event, CL_PROFILING_COMMAND_END, sizeof(end), &end, nullptr),
          "clGetEventProfilingInfo");
    return 1e-9 * double(end - start);
}

}  // namespace

// --- kernels ------------------------------------------------------------------------------------

Kernel& Program::operator[](const std::string& name) {
    const auto found = kernels_.find(name);
    if (found != kernels_.end()) return found->second;
    cl_int code = CL_SUCCESS;
    Kernel kernel{name, KernelHandle(api().CreateKernel(program_, name.c_str(), &code)), 1};
    check(code, "kernel '" + name + "'");
    check(
        api().GetKernelWorkGroupInfo(kernel.handle.get(), device_.id(), CL_KERNEL_WORK_GROUP_SIZE,
                                     sizeof(kernel.largest_group), &kernel.largest_group, nullptr),
        "clGetKernelWorkGroupInfo of '" + name + "'");
    return kernels_.emplace(name, std::move(kernel)).first->second;
}

// --- times --------------------------------------------------------------------------------------

double Times::kernel_seconds() const {
    double sum = 0.0;
    for (const KernelTime& time : kernels) sum += time.seconds;
    return sum;
}

double Times::stage_seconds(const std::string& stage) const {
    double sum = 0.0;
    for (const KernelTime& time : kernels)
        if (time.stage == stage) sum += time.seconds;
    return sum;
}

// --- commands -----------------------------------------------------------------------------------

Commands::Commands(Device& device, const Token& token)
    : work_group(
          std::min<std::size_t>(device.info().is_gpu ? 128 : 64, device.info().largest_work_group)),
      suits_gpu(device.info().is_gpu),
      use_sub_groups(device.info().sub_groups.usable),
      device_(device),
      token_(token) {
    cl_int code = CL_SUCCESS;
    queue_.reset(
        api().CreateCommandQueue(device.context(), device.id(), CL_QUEUE_PROFILING_ENABLE, &code));
    check(code, "a queue on device '" + device.info().id + "'");
}

Commands::~Commands() {
    api().Finish(queue_.get());  // buffers must outlive the commands that use them
}

void Commands::set_bytes(Kernel& kernel, cl_uint index, std::size_t size, const void* bytes) {
    check(api().SetKernelArg(kernel.handle.get(), index, size, bytes),
          "argument " + std::to_string(index) + " of kernel '" + kernel.name + "'");
}

void Commands::launch(Kernel& kernel, const Range& range) {
    token_.check();
    const std::size_t wanted = range.group ? range.group : work_group;
    const std::size_t group = std::min(wanted, kernel.largest_group);
    if (range.group && group != range.group)
        throw Error("kernel '" + kernel.name + "' cannot run in groups of " +
                    std::to_string(range.group) + " on device '" + device_.info().id + "'");
    const std::size_t global = (range.items + group - 1) / group * group;
    cl_event event = nullptr;
    check(api().EnqueueNDRangeKernel(queue_.get(), kernel.handle.get(), 1, nullptr, &global, &group,
                                     0, nullptr, &event),
          "kernel '" + kernel.name + "' on device '" + device_.info().id + "'");
    note(event, kernel.name, 0);
}

void Commands::write(cl_mem target, const void* bytes, std::size_t size) {
    if (size == 0) return;
    token_.check();
    cl_event event = nullptr;
    check(
        api().EnqueueWriteBuffer(queue_.get(), target, CL_TRUE, 0, size, bytes, 0, nullptr, &event),
        "copying to device '" + device_.info().id + "'");
    note(event, "upload", size);
}

void Commands::read(cl_mem source, std::size_t offset, void* bytes, std::size_t size) {
    finish();
    if (size == 0) return;
    cl_event event = nullptr;
    check(api().EnqueueReadBuffer(queue_.get(), source, CL_TRUE, offset, size, bytes, 0, nullptr,
                                  &event),
          "copying from device '" + device_.info().id + "'");
    note(event, "download", size);
    take_times();
}

void Commands::fill_bytes(cl_mem target, const void* pattern, std::size_t pattern_size,
                          std::size_t size) {
    if (size == 0) return;
    token_.check();
    cl_event event = nullptr;
    check(api().EnqueueFillBuffer(queue_.get(), target, pattern, pattern_size, 0, size, 0, nullptr,
                                  &event),
          "filling a buffer on device '" + device_.info().id + "'");
    note(event, "fill", 0);
}

void Commands::copy_bytes(cl_mem source, cl_mem target, std::size_t size) {
    if (size == 0) return;
    token_.check();
    cl_event event = nullptr;
    check(api().EnqueueCopyBuffer(queue_.get(), source, target, 0, 0, size, 0, nullptr, &event),
          "copying a buffer on device '" + device_.info().id + "'");
    note(event, "copy", 0);
}

void Commands::note(cl_event event, const std::string& name, std::size_t transfer_bytes) {
    pending_.push_back({EventHandle(event), stage_, name, transfer_bytes});
    if (pending_.size() >= most_pending) finish();
}

void Commands::finish() {
    check(api().Finish(queue_.get()), "waiting for device '" + device_.info().id + "'");
    take_times();
    token_.check();
}

/// Adds up the times of commands that have ended.
void Commands::take_times() {
    for (const Pending& command : pending_) {
        cl_int status = CL_COMPLETE;
        check(api().GetEventInfo(command.event.get(), CL_EVENT_COMMAND_EXECUTION_STATUS,
                                 sizeof(status), &status, nullptr),
              "clGetEventInfo");
        if (status < 0)
            check(status, "'" + command.name + "' on device '" + device_.info().id + "'");
        const double seconds = profiled_seconds(command.event.get());
        if (command.transfer_bytes) {
            times_.transfer_seconds += seconds;
            times_.transfer_bytes += command.transfer_bytes;
            continue;
        }
        auto known = std::ranges::find_if(times_.kernels, [&](const KernelTime& time) {
            return time.kernel == command.name && time.stage == command.stage;
        });
        if (known == times_.kernels.end())
            known = times_.kernels.insert(known, {command.stage, command.name, 0, 0.0});
        ++known->launches;
        known->seconds += seconds;
    }
    pending_.clear();
}

}  // namespace bvhlab::opencl
