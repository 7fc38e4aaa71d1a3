// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/cost.h"

#include <functional>

#include "base/parallel.h"
#include "bvh/binary_bvh.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {
namespace {

template <class Tree>
double cost_of(const Tree& wide, const CostModel& model) {
    constexpr unsigned k = Tree::branching;
    const WideNode<k>& root = wide.node(0);
    Box scene = Box::empty();
    for (unsigned i = 0; i < k; ++i) scene.grow(root.box(i));
    const double root_area = scene.half_area();
    const double scale = root_area > 0.0 ? 1.0 / root_area : 0.0;

    double cost = model.traversal;  // the root
    for (std::size_t index = 0; index < wide.nodes.size(); ++index) {
        const WideNode<k>& node = wide.node(index);
        for (unsigned i = 0; i < k; ++i) {
            const double work = node.is_leaf(i)
                                    ? model.intersection * double(Tree::charged(node.count[i]))
                                    : model.traversal;
            cost += node.box(i).half_area() * scale * work;
        }
    }
    return cost;
}

}  // namespace

double cost(const Bvh& bvh, const CostModel& model) {
    return std::visit([&](const auto& wide) { return cost_of(wide, model); }, bvh.tree);
}

double cost(const BinaryBvh& bvh, const CostModel& model) {
    const double root_area = bvh.boxes[0].half_area();
    if (root_area <= 0.0) return model.traversal;
    const auto sum = [&](const IndexRange& nodes, double areas) {
        for (std::size_t node = nodes.begin(); node < nodes.end(); ++node)
            areas += bvh.boxes[node].half_area() *
                     (bvh.is_leaf(std::uint32_t(node)) ? model.intersection : model.traversal);
        return areas;
    };
    constexpr std::size_t grain = 4096;
    return parallel_sum(0, bvh.node_count(), grain, 0.0, sum) / root_area;
}

}  // namespace bvhlab
