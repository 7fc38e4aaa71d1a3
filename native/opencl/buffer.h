// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

#include "opencl/device.h"

namespace bvhlab::opencl {

/// Bytes of a device's memory, given back when it goes.
class Memory {
public:
    Memory() = default;
    /// Throws MemoryError with what is needed and what there is.
    Memory(Device& device, std::size_t bytes);
    ~Memory();
    Memory(Memory&& other) noexcept;
    Memory& operator=(Memory&& other) noexcept;

    cl_mem get() const { return handle_.get(); }

private:
    Device* device_ = nullptr;
    std::size_t bytes_ = 0;
    MemoryHandle handle_;
};

/// An array on a device. `T` has the same layout there: a number, or a struct that a kernel file
/// declares member for member. Uninitialised at first.
template <class T>
class Buffer {
public:
    Buffer() = default;
    Buffer(Device& device, std::size_t count)
        : memory_(device, (count ? count : 1) * sizeof(T)), count_(count) {}

    std::size_t size() const { return count_; }
    std::size_t bytes() const { return count_ * sizeof(T); }
    cl_mem get() const { return memory_.get(); }

private:
    Memory memory_;
    std::size_t count_ = 0;
};

}  // namespace bvhlab::opencl
