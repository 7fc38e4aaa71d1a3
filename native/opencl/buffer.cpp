// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/buffer.h"

#include <string>
#include <utility>

namespace bvhlab::opencl {
namespace {

std::string megabytes(std::uint64_t bytes) {
    constexpr std::uint64_t mega = 1U << 20U;
    return std::to_string((bytes + mega - 1) / mega) + " MiB";
}

}  // namespace

Memory::Memory(Device& device, std::size_t bytes) {
    const DeviceInfo& info = device.info();
    if (bytes > info.largest_buffer)
        throw MemoryError("device '" + info.id + "' allows no buffer larger than " +
                          megabytes(info.largest_buffer) + ", and " + megabytes(bytes) +
                          " are needed");
    device.take_memory(bytes);
    cl_int code = CL_SUCCESS;
    handle_.reset(api().CreateBuffer(device.context(), CL_MEM_READ_WRITE, bytes, nullptr, &code));
    if (code != CL_SUCCESS) device.give_memory(bytes);
    check(code, "a buffer of " + megabytes(bytes) + " on device '" + info.id + "'");
    device_ = &device;
    bytes_ = bytes;
}

Memory::~Memory() {
    if (device_) device_->give_memory(bytes_);
}

Memory::Memory(Memory&& other) noexcept
    : device_(std::exchange(other.device_, nullptr)),
      bytes_(std::exchange(other.bytes_, 0)),
      handle_(std::move(other.handle_)) {}

Memory& Memory::operator=(Memory&& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(bytes_, other.bytes_);
    std::swap(handle_, other.handle_);
    return *this;
}

void Device::take_memory(std::size_t bytes) {
    const std::size_t taken = memory_taken_.fetch_add(bytes) + bytes;
    if (taken <= info_.memory) return;
    memory_taken_ -= bytes;
    throw MemoryError("device '" + info_.id + "' has " + megabytes(info_.memory) + ", and " +
                      megabytes(taken) + " are needed");
}

}  // namespace bvhlab::opencl
