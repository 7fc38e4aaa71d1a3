// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "build/builder.h"
#include "build/treelet.h"

namespace bvhlab {

/// Settings of build_trbvh; the defaults are those of Karras and Aila. Each is a parameter of the
/// builder of the same name.
struct TrbvhConfig {
    int treelet_size = 7;
    int iterations = 3;
    double max_seconds = 0.0;
};

inline constexpr std::array<ParameterInfo, 3> trbvh_parameters{{
    {"treelet_size", double(TrbvhConfig{}.treelet_size), 3.0, 8.0, true, "leaves",
     "leaves of the treelets that are optimised; time grows with 3 to this power",
     "Karras and Aila 2013"},
    {"iterations", double(TrbvhConfig{}.iterations), 0.0, 64.0, true, "passes",
     "limit on passes over the tree; they also end when the threshold, which doubles each pass, "
     "exceeds the number of triangles",
     "Karras and Aila 2013"},
    {"max_seconds", TrbvhConfig{}.max_seconds, 0.0, 1e6, false, "s",
     "limit on the build time; 0 is no limit", "ours"},
}};

/// The settings in checked parameters (check_parameters).
TrbvhConfig trbvh_config(const Parameters& parameters);

/// Treelet restructuring (Karras and Aila 2013): takes the LBVH and gives the treelet under each
/// node, bottom-up, its optimal topology, found by dynamic programming over all sets of its leaves.
///
/// What is minimised is the SAH cost after leaves are collapsed (Eq. 2): a set of treelet leaves
/// counts as one leaf where that is cheaper. The tree returned still has one reference per leaf;
/// below a set that counts as a leaf stands its best topology of nodes, and the collapse, which
/// weighs the same alternatives, makes the leaf. The log's cost is that of the tree as returned,
/// which is not what is minimised and may rise.
///
/// Nodes are numbered depth-first; the tree is the same for any thread count, unless the time limit
/// ends the build. Throws Cancelled.
BinaryBvh build_trbvh(const Mesh& mesh, const CostModel& model, const TrbvhConfig& config,
                      Token& token, BuildLog& log);

}  // namespace bvhlab
