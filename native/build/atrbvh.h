// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "build/builder.h"
#include "build/treelet.h"

namespace bvhlab {

/// Settings of build_atrbvh; the defaults are the paper's. Each is a parameter of the builder of
/// the same name.
struct AtrbvhConfig {
    int treelet_size = 20;
    int iterations = 20;
    double max_seconds = 0.0;
};

inline constexpr std::array<ParameterInfo, 3> atrbvh_parameters{{
    {"treelet_size", double(AtrbvhConfig{}.treelet_size), 4.0, double(max_treelet_size), true,
     "leaves", "leaves of the treelets that are rebuilt",
     "Meister and Bittner 2022, released framework"},
    {"iterations", double(AtrbvhConfig{}.iterations), 0.0, 64.0, true, "passes",
     "limit on passes over the tree; they also end when the threshold, which doubles each pass, "
     "exceeds the number of triangles",
     "Meister and Bittner 2022, section 4"},
    {"max_seconds", AtrbvhConfig{}.max_seconds, 0.0, 1e6, false, "s",
     "limit on the build time; 0 is no limit", "ours"},
}};

/// The settings in checked parameters (check_parameters).
AtrbvhConfig atrbvh_config(const Parameters& parameters);

/// Agglomerative treelet restructuring (Domingues and Pedrini 2015): takes the LBVH and rebuilds
/// the treelet under each node, bottom-up, by agglomerative clustering, wherever that lowers the
/// SAH cost with one reference per leaf.
///
/// Nodes are numbered depth-first; the tree is the same for any thread count, unless the time limit
/// ends the build. Throws Cancelled.
BinaryBvh build_atrbvh(const Mesh& mesh, const CostModel& model, const AtrbvhConfig& config,
                       Token& token, BuildLog& log);

}  // namespace bvhlab
