// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/token.h"
#include "bvh/binary_bvh.h"

namespace bvhlab {

/// The same tree with interior nodes and leaves each renumbered in depth-first order, left child
/// first. The references below a node are one contiguous range then, and a search through the tree
/// reads memory nearly in order.
///
/// Linear in time, and the same for any thread count. Throws Cancelled.
BinaryBvh depth_first(const BinaryBvh& bvh, const Token& token = Token());

}  // namespace bvhlab
