// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/hybrid.h"

#include "build/leaf_clusters.h"

namespace bvhlab {
namespace {

/// Cost of the references that leaves hold beyond their first one, relative to the root's area.
double cost_of_leaves(const LeafClusters& clusters, const CostModel& model) {
    const BinaryBvh& top = clusters.top;
    const double root_area = top.boxes[0].half_area();
    double cost = 0.0;
    for (std::size_t i = 0; i < clusters.sizes.size(); ++i)
        cost += top.boxes[top.first_leaf() + i].half_area() * double(clusters.sizes[i] - 1);
    return root_area > 0.0 ? cost * model.intersection / root_area : 0.0;
}

}  // namespace

BinaryBvh build_hybrid(const Mesh& mesh, const CostModel& model, const SbvhConfig& base_config,
                       const PrbvhConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_sbvh(mesh, model, base_config, token);
    token.begin("building Hybrid");
    const LeafClusters clusters = cut_leaf_clusters(base, model, token);
    const BinaryBvh top =
        climb(clusters.top, model, config, clock, token, log, cost_of_leaves(clusters, model));
    return put_back(top, clusters, base, token);
}

}  // namespace bvhlab
