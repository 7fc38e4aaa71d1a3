// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "build/prbvh.h"

namespace bvhlab {

/// The same parameters as prbvh_s: a base by build_sbvh, then hill climbing.
inline constexpr auto hybrid_parameters = prbvh_s_parameters;

/// Reinsertion only where it can change what is traversed (after the future work in section 5 of
/// the paper): in an SBVH, subtrees that the collapse would turn into leaves are taken as leaves,
/// and the nodes above them are optimised by parallel reinsertion as in build_prbvh_s. What is
/// inside a leaf keeps its topology, for it costs nothing.
///
/// Some 40% of the nodes are left to search and to search through. Numbered depth-first; the same
/// for any thread count. Throws Cancelled.
BinaryBvh build_hybrid(const Mesh& mesh, const CostModel& model, const SbvhConfig& base,
                       const PrbvhConfig& config, Token& token, BuildLog& log);

}  // namespace bvhlab
