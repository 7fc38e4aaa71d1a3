// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "base/token.h"
#include "bvh/cost.h"
#include "bvh/leaf_count_variability.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// How deep the leaves are and how many references they hold.
struct Shape {
    std::size_t max_depth = 0;     ///< interior nodes on the longest way from the root to a leaf
    double mean_leaf_depth = 0.0;  ///< the same, on average over leaves
    std::vector<std::size_t> leaf_sizes;  ///< number of leaves, by the references they hold
};

Shape shape(const Bvh& bvh);

/// Quality of a finished tree, as rays see it.
struct Metrics {
    double cost = 0.0;       ///< Eq. 2 or 3 (cost.h)
    double epo = 0.0;        ///< end-point overlap (epo.h), in the unit of `cost`
    LeafCounts leaf_counts;  ///< mean and variability of leaves met (leaf_count_variability.h)
    Shape shape;
    std::size_t nodes = 0;  ///< interior nodes and leaves
    std::size_t leaves = 0;
    std::size_t references = 0;
    std::size_t bytes = 0;  ///< interior nodes and triangle blocks
};

/// All metrics, with `lines` random lines for leaf counts, at least 2. Throws Cancelled.
Metrics measure(const Bvh& bvh, const CostModel& model, std::size_t lines, Token& token);

}  // namespace bvhlab
