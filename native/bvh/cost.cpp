// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/cost.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <functional>

#include "bvh/binary_bvh.h"
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

double cost(const BinaryBvh& bvh, const CostModel& model) {
    const double root_area = bvh.boxes[0].half_area();
    if (root_area <= 0.0) return model.traversal;
    const auto sum = [&](const tbb::blocked_range<std::size_t>& nodes, double areas) {
        for (std::size_t node = nodes.begin(); node < nodes.end(); ++node)
            areas += bvh.boxes[node].half_area() *
                     (bvh.is_leaf(std::uint32_t(node)) ? model.intersection : model.traversal);
        return areas;
    };
    constexpr std::size_t grain = 4096;
    return tbb::parallel_deterministic_reduce(
               tbb::blocked_range<std::size_t>(0, bvh.node_count(), grain), 0.0, sum,
               std::plus<>()) /
           root_area;
}

}  // namespace bvhlab
