// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/array.h"
#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"

namespace bvhlab {

/// A tree cut off where leaves are cheaper.
struct LeafClusters {
    BinaryBvh top;               ///< leaf i, without children, stands for ...
    Array<std::uint32_t> roots;  ///< ... this node of the tree that was cut; top.references[i] = i
};

/// Cuts `bvh` at the nodes that are cheapest as leaves by Eq. 2: those which the collapse to a
/// binary tree turns into leaves. The root is not cut off where it has children. Throws Cancelled.
LeafClusters cut_leaf_clusters(const BinaryBvh& bvh, const CostModel& model, const Token& token);

/// Puts the subtrees of `bvh` back in the places of the leaves of `top`, which may have moved.
/// Throws Cancelled.
BinaryBvh put_back(const BinaryBvh& top, const LeafClusters& clusters, const BinaryBvh& bvh,
                   const Token& token);

}  // namespace bvhlab
