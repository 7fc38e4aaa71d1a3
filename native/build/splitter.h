// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <utility>

#include "build/object_split.h"
#include "build/spatial_split.h"
#include "build/top_down.h"

namespace bvhlab {

/// What is known of a node before it is split, beside its references.
struct NodeState {
    std::size_t size;    ///< references
    std::size_t budget;  ///< duplicates that its subtree may make
    int depth;
    bool spatial;  ///< whether spatial splits may be tried in its subtree
};

/// Memory that splitting one node after the other needs.
struct SplitScratch {
    Array<std::uint32_t> ranks;
    SpatialDivision division;
    SpatialBins bins;
};

/// Splits nodes by the rule of a configuration.
class Splitter {
public:
    Splitter(const Mesh& mesh, const TopDownConfig& config, const Token& token)
        : mesh_(mesh),
          config_(config),
          token_(token),
          min_overlap_area_(config.min_overlap * mesh.bounds.half_area()) {}

    /// Divides a node of at least two references. `allocate(left_size, right_size)` returns the two
    /// targets to write the children's references to; it may not move `node`.
    template <class Allocate>
    std::pair<NodeState, NodeState> split(const ReferenceView& node, const NodeState& state,
                                          SplitScratch& scratch, Allocate&& allocate) const {
        const Plan plan = make_plan(node, state, scratch);
        std::size_t left_size = plan.object.left_size, right_size = state.size - left_size;
        std::size_t budget = state.budget;
        if (plan.spatial) {
            left_size = scratch.division.left_size;
            right_size = scratch.division.right_size;
            budget -= scratch.division.duplicates();
        }
        const auto [left, right] = allocate(left_size, right_size);
        if (plan.spatial)
            divide_space(node, scratch.division, scratch.ranks, left, right, token_);
        else
            divide_objects(node, plan.object, scratch.ranks, left, right, token_);
        const auto left_budget =
            std::size_t(double(budget) * double(left_size) / double(left_size + right_size));
        const NodeState child{0, 0, state.depth + 1, plan.spatial_below};
        return {{left_size, left_budget, child.depth, child.spatial},
                {right_size, budget - left_budget, child.depth, child.spatial}};
    }

private:
    struct Plan {
        ObjectSplit object;
        bool spatial = false;        ///< take the division in the scratch memory instead
        bool spatial_below = false;  ///< children may try spatial splits
    };

    Plan make_plan(const ReferenceView& node, const NodeState& state, SplitScratch& scratch) const;

    const Mesh& mesh_;
    const TopDownConfig& config_;
    const Token& token_;
    double min_overlap_area_;
};

}  // namespace bvhlab
