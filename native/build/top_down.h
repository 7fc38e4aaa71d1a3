// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"
#include "scene/mesh.h"

namespace bvhlab {

/// How a tree is grown from the root down to single references.
struct TopDownConfig {
    const char* stage;  ///< what the token shows; a string literal
    CostModel model;

    /// Spatial splits are tried at a depth below this (the root's depth is 0); 0: never.
    int max_spatial_depth = 0;
    int spatial_bins = 0;  ///< per axis, at most most_spatial_bins
    /// ... where the children of the best object split overlap in at least this share of the
    /// scene's area,
    double min_overlap = 0.0;
    /// ... and not below a node of at most so many references that would be cheapest as a leaf.
    std::size_t max_leaf_size = 0;
    /// References that spatial splits may add in all. A node's share of what is left goes by its
    /// size.
    std::size_t duplicate_budget = 0;
};

/// Grows the tree with one task per subtree, large nodes in parallel inside too. Interior nodes and
/// leaves are numbered depth-first; the result does not depend on the thread count. Throws
/// Cancelled.
BinaryBvh build_top_down(const Mesh& mesh, const TopDownConfig& config, Token& token);

}  // namespace bvhlab
