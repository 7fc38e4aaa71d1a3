// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/splitter.h"

#include <algorithm>

namespace bvhlab {

Splitter::Plan Splitter::make_plan(const ReferenceView& node, const NodeState& state,
                                   SplitScratch& scratch) const {
    Plan plan;
    plan.object = find_object_split(node, token_);
    if (!state.spatial || state.depth >= config_.max_spatial_depth) return plan;
    plan.spatial_below = true;

    // A node that is cheapest as a leaf goes on without spatial splits: the collapse decides on
    // leaves, and cutting what will share a leaf only adds references.
    const auto [left, right] = side_boxes(node, plan.object, token_);
    const Box bounds = unite(left, right);
    double limit = plan.object.cost;  // that a spatial split must beat
    if (state.size <= config_.max_leaf_size) {
        const double visit_in_tests = config_.model.traversal / config_.model.intersection;
        const double as_leaf = bounds.half_area() * (double(state.size) - visit_in_tests);
        plan.spatial_below = as_leaf > plan.object.cost;
        limit = std::min(limit, as_leaf);
    }

    // Look for one where the object split leaves overlap (Stich et al. 2009, section 4.5).
    const Box overlap = intersect(left, right);
    if (state.budget == 0 || overlap.is_empty() || overlap.half_area() < min_overlap_area_)
        return plan;
    const SpatialSplit space = find_spatial_split(node, bounds, mesh_, config_.spatial_bins,
                                                  state.budget, limit, scratch.bins, token_);
    if (space.cost < limit) {
        plan.spatial_below = true;
        decide_sides(node, space, mesh_, state.budget, scratch.division, token_);
        plan.spatial = scratch.division.left_size > 0 && scratch.division.right_size > 0;
    }
    return plan;
}

}  // namespace bvhlab
