// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "opencl/commands.h"

namespace bvhlab::opencl {

/// Sorts the first `count` keys ascending, at most 2^32 - 1, and values with them; equal keys keep
/// their order. No key may have a bit set above the lowest `key_bits`. The buffers are replaced by
/// sorted ones of the same sizes; elements beyond `count` are lost. Enqueues and does not wait.
///
/// A CPU sorts runs of thousands of keys for each work-item, a GPU tiles in the local memory of a
/// work-group; the result is the same.
void radix_sort(Commands& commands, Buffer<std::uint64_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, int key_bits);
void radix_sort(Commands& commands, Buffer<std::uint32_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, int key_bits);

}  // namespace bvhlab::opencl
