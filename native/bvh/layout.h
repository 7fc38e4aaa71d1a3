// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// How one binary node is best represented by at most j = 1..k-1 wide trees.
template <unsigned K>
struct Plan {
    static constexpr std::uint8_t leaf = 0;      ///< j = 1: one leaf of all references
    static constexpr std::uint8_t fewer = 0xFF;  ///< j > 1: as for j - 1

    std::array<float, K + 1> cost;  ///< C(N, j), at [j]
    std::array<std::uint8_t, K + 1>
        left_share;           ///< trees of the left child, or `leaf` or `fewer`, at [j]
    std::uint8_t node_share;  ///< trees of the left child where N is a wide node
    std::uint32_t size;       ///< references below N
};

/// Lays the planned tree out breadth-first (paper section 3): nodes level by level, in each level
/// from left to right; leaves in the order in which their parents come, references of a leaf
/// depth-first.
template <unsigned K>
Bvh breadth_first_layout(const BinaryBvh& binary, const Array<Plan<K>>& plans,
                         std::shared_ptr<const Mesh> mesh, Token& token);

/// The same as compressed nodes, siblings in order of their slots. No leaf may have more than
/// CompressedNode::most_references references.
Bvh compressed_layout(const BinaryBvh& binary, const Array<Plan<8>>& plans,
                      std::shared_ptr<const Mesh> mesh, Token& token);

}  // namespace bvhlab
