// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "opencl/commands.h"

namespace bvhlab::opencl {

/// Exclusive prefix sums; an object for many of them, as it keeps the kernels.
class Scan {
public:
    explicit Scan(Commands& commands)
        : commands_(commands), program_(commands.device(), {{"scan.cl"}, ""}) {}

    /// As exclusive_scan.
    void operator()(const Buffer<std::uint32_t>& values, std::size_t count,
                    const Buffer<std::uint32_t>& total);

private:
    Commands& commands_;
    Program program_;
};

/// Replaces each of the first `count` values, at most 2^32 - 1, by the sum of those before it, and
/// writes the sum of all to total[0]; sums are modulo 2^32. Enqueues and does not wait.
void exclusive_scan(Commands& commands, const Buffer<std::uint32_t>& values, std::size_t count,
                    const Buffer<std::uint32_t>& total);

}  // namespace bvhlab::opencl
