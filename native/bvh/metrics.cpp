// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/metrics.h"

#include <algorithm>

#include "bvh/epo.h"

namespace bvhlab {
namespace {

template <class Tree>
Shape shape_of(const Tree& wide) {
    constexpr unsigned k = Tree::branching;
    Shape shape;
    std::vector<std::size_t> depth(wide.nodes.size(), 0);
    depth[0] = 1;
    std::size_t leaves = 0, depths = 0;
    for (std::size_t node = 0; node < wide.nodes.size(); ++node) {  // parents come first
        const WideNode<k>& parent = wide.node(node);
        for (unsigned i = 0; i < k && !parent.is_missing(i); ++i) {
            if (!parent.is_leaf(i)) {
                depth[parent.child[i]] = depth[node] + 1;
                continue;
            }
            const std::size_t size = parent.count[i];
            if (shape.leaf_sizes.size() <= size) shape.leaf_sizes.resize(size + 1, 0);
            ++shape.leaf_sizes[size];
            ++leaves;
            depths += depth[node];
            shape.max_depth = std::max(shape.max_depth, depth[node]);
        }
    }
    shape.mean_leaf_depth = double(depths) / double(leaves);
    return shape;
}

}  // namespace

Shape shape(const Bvh& bvh) {
    return std::visit([](const auto& wide) { return shape_of(wide); }, bvh.tree);
}

Metrics measure(const Bvh& bvh, const CostModel& model, std::size_t lines, Token& token) {
    Metrics metrics;
    metrics.cost = cost(bvh, model);
    metrics.epo = end_point_overlap(bvh, model, token);
    metrics.leaf_counts = leaf_count_variability(bvh, lines, token);
    metrics.shape = shape(bvh);
    metrics.nodes = bvh.interior_count() + bvh.leaf_count;
    metrics.leaves = bvh.leaf_count;
    metrics.references = bvh.reference_count;
    metrics.bytes = bvh.node_bytes() + bvh.leaf_bytes();
    return metrics;
}

}  // namespace bvhlab
