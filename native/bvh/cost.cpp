// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/cost.h"

#include "bvh/wide_bvh.h"

namespace bvhlab {
namespace {

template <unsigned K>
double cost_of(const WideBvh<K>& wide, const CostModel& model) {
    Box scene = Box::empty();
    for (unsigned i = 0; i < K; ++i) scene.grow(wide.nodes[0].box(i));
    const double root_area = scene.half_area();
    const double scale = root_area > 0.0 ? 1.0 / root_area : 0.0;

    double cost = model.traversal;  // the root
    for (const WideNode<K>& node : wide.nodes) {
        for (unsigned i = 0; i < K; ++i) {
            const double work = node.is_leaf(i)
                                    ? model.intersection * double(charged_tests(node.count[i], K))
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

}  // namespace bvhlab
