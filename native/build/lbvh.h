// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/array.h"
#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Linear BVH (Lauterbach et al. 2009) with the topology of Karras 2012: triangles sorted by the
/// 60-bit Morton code of their box centres, each node split where the highest differing bit of its
/// codes changes. Equal codes are told apart by their place in the sorted order, so depth is at
/// most 60 + 28.
///
/// Interior nodes come in depth-first order and leaves in sorted order. Throws Cancelled.
BinaryBvh build_lbvh(const Mesh& mesh, Token& token);

/// Builds the subtrees of that tree, boxes on the way up; the boxes of the leaves must be there.
/// A subtree over the places first..last of the sorted order has its last - first interior nodes at
/// node, node + 1, ... in depth-first order, and the leaf of place i is leaf number i + leaf_shift
/// (modulo 2^32).
struct LbvhSubtrees {
    const Array<std::uint64_t>& codes;
    BinaryBvh& bvh;
    const Token& token;
    std::uint32_t leaf_shift = 0;

    /// Returns the root of the subtree. Recursion is at most 60 + 28 deep.
    std::uint32_t build(std::uint32_t node, std::uint32_t first, std::uint32_t last) const;
};

}  // namespace bvhlab
