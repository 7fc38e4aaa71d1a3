// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "build/builder.h"

namespace bvhlab {

/// Settings of build_hlbvh; the defaults are the paper's.
struct HlbvhConfig {
    int sah_bits = 15;
};

inline constexpr std::array<ParameterInfo, 1> hlbvh_parameters{{
    {"sah_bits", double(HlbvhConfig{}.sah_bits), 3.0, 21.0, true, "bits",
     "triangles that share this many leading bits of their Morton code form a cluster; a third of "
     "it gives the cells per axis, as a power of two",
     "Meister and Bittner 2022, section 4"},
}};

/// The settings in checked parameters (check_parameters).
HlbvhConfig hlbvh_config(const Parameters& parameters);

/// Hierarchical LBVH (Pantaleoni and Luebke 2010; queues as by Garanzha et al. 2011 are not needed
/// here): the subtrees of build_lbvh below the cells of a coarse grid, and above them a tree built
/// top-down by the binned surface area heuristic, with the clusters as primitives.
///
/// The division does not depend on a cost model. Nodes are numbered depth-first; depth is at most
/// 3 * 2^(sah_bits / 3) above the clusters and 60 + 28 below; the tree is the same for any thread
/// count. Throws Cancelled.
BinaryBvh build_hlbvh(const Mesh& mesh, const HlbvhConfig& config, Token& token);

}  // namespace bvhlab
