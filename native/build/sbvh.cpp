// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/sbvh.h"

#include <algorithm>

#include "build/top_down.h"

namespace bvhlab {

SbvhConfig sbvh_config(const Parameters& parameters) {
    const auto value = [&](std::string_view name) { return parameters.find(name)->second; };
    return {.alpha = value("alpha"),
            .spatial_bins = int(value("spatial_bins")),
            .max_spatial_depth = int(value("max_spatial_depth")),
            .max_leaf_size = int(value("max_leaf_size")),
            .max_references = value("max_references")};
}

std::size_t duplicate_budget(std::size_t triangles, double max_references) {
    const double wanted = (max_references - 1.0) * double(triangles);
    return std::size_t(std::min(wanted, double(most_references - triangles)));
}

BinaryBvh build_sbvh(const Mesh& mesh, const CostModel& model, const SbvhConfig& config,
                     Token& token) {
    return build_top_down(
        mesh,
        {.stage = "building SBVH",
         .model = model,
         .max_spatial_depth = config.max_spatial_depth,
         .spatial_bins = config.spatial_bins,
         .min_overlap = config.alpha,
         .max_leaf_size = std::size_t(config.max_leaf_size),
         .duplicate_budget = duplicate_budget(mesh.size(), config.max_references)},
        token);
}

}  // namespace bvhlab
