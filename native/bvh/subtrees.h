// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <limits>

#include "base/array.h"
#include "base/token.h"
#include "bvh/cost.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// What lies at and below each interior node of a wide tree, by node.
///
/// What meets `common` meets every box below the node, so nobody need go there to count them: trees
/// over many triangles in one place, whose boxes are all alike, cost no quadratic time.
struct Subtrees {
    Array<std::uint32_t> leaves;  ///< number of leaves
    Array<double> work;           ///< sum of C_n over the node itself and all nodes below it
    Array<Box> common;            ///< what all leaf boxes share; empty where that is nothing
};

/// C_n, the cost of one visit: c_T for an interior node, c_I times the tests charged for a leaf.
template <class Tree>
double node_work(const WideNode<Tree::branching>& parent, unsigned child, const CostModel& model) {
    if (!parent.is_leaf(child)) return model.traversal;
    return model.intersection * double(Tree::charged(parent.count[child]));
}

template <class Tree>
Subtrees find_subtrees(const Tree& wide, const CostModel& model, const Token& token) {
    constexpr unsigned k = Tree::branching;
    const std::size_t nodes = wide.nodes.size();
    Subtrees below{Array<std::uint32_t>(nodes), Array<double>(nodes), Array<Box>(nodes)};
    constexpr float infinity = std::numeric_limits<float>::infinity();
    for (std::size_t node = nodes; node-- > 0;) {  // breadth-first: children stand behind
        if (node % 4096 == 0) token.check();
        std::uint32_t leaves = 0;
        double work = model.traversal;
        Box common{glm::vec3(-infinity), glm::vec3(infinity)};
        const WideNode<k>& parent = wide.node(node);
        for (unsigned i = 0; i < k && !parent.is_missing(i); ++i) {
            const bool leaf = parent.is_leaf(i);
            const std::uint32_t child = parent.child[i];
            leaves += leaf ? 1 : below.leaves[child];
            work += leaf ? node_work<Tree>(parent, i, model) : below.work[child];
            common = intersect(common, leaf ? parent.box(i) : below.common[child]);
        }
        below.leaves[node] = leaves;
        below.work[node] = work;
        below.common[node] = common;
    }
    return below;
}

}  // namespace bvhlab
