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

BinaryBvh build_sbvh(const Mesh& mesh, const CostModel& model, const SbvhConfig& config,
                     Token& token) {
    // Node numbers have 32 bits, so there can be at most 2^31 references.
    const double most_duplicates = double((std::size_t(1) << 31) - mesh.size());
    const double duplicates = (config.max_references - 1.0) * double(mesh.size());
    return build_top_down(mesh,
                          {.stage = "building SBVH",
                           .model = model,
                           .max_spatial_depth = config.max_spatial_depth,
                           .spatial_bins = config.spatial_bins,
                           .min_overlap = config.alpha,
                           .max_leaf_size = std::size_t(config.max_leaf_size),
                           .duplicate_budget = std::size_t(std::min(duplicates, most_duplicates))},
                          token);
}

}  // namespace bvhlab
