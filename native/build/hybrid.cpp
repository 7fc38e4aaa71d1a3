// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/hybrid.h"

#include "build/leaf_clusters.h"

namespace bvhlab {

BinaryBvh build_hybrid(const Mesh& mesh, const CostModel& model, const SbvhConfig& base_config,
                       const PrbvhConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_sbvh(mesh, model, base_config, token);
    token.begin("building Hybrid");
    const LeafClusters clusters = cut_leaf_clusters(base, model, token);
    const double cost_below = cost(base, model) - cost(clusters.top, model);
    const BinaryBvh top = climb(clusters.top, model, config, clock, token, log, cost_below);
    return put_back(top, clusters, base, token);
}

}  // namespace bvhlab
