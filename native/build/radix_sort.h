// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/array.h"
#include "base/token.h"

namespace bvhlab {

/// Sorts keys ascending, and values with them; equal keys keep their order (least significant digit
/// first, as Merrill and Grimshaw 2011). No key may have a bit set above the lowest `key_bits`.
///
/// The result does not depend on the thread count. Throws Cancelled between passes.
void radix_sort(Array<std::uint64_t>& keys, Array<std::uint32_t>& values, int key_bits,
                const Token& token);
void radix_sort(Array<std::uint32_t>& keys, Array<std::uint32_t>& values, int key_bits,
                const Token& token);

}  // namespace bvhlab
