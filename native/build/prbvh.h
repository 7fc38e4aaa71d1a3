// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "base/parallel.h"
#include "build/builder.h"
#include "build/sbvh.h"

namespace bvhlab {

/// Settings of the hill climbing builders; the defaults are the paper's where it has them.
struct PrbvhConfig {
    int iterations = 1000;
    double max_seconds = 0.0;
    double threshold = 0.01;
    int sparsity = 1;
    int lock_rounds = 3;
};

inline constexpr std::array<ParameterInfo, 5> prbvh_parameters{{
    {"iterations", double(PrbvhConfig{}.iterations), 0.0, 1e6, true, "iterations",
     "limit; 0 returns the base tree", "ours; the paper has no limit"},
    {"max_seconds", PrbvhConfig{}.max_seconds, 0.0, 1e6, false, "seconds",
     "limit on the build time, looked at after each iteration; 0 for none",
     "ours; the paper has no limit"},
    {"threshold", PrbvhConfig{}.threshold, 0.0, 1e6, false, "cost",
     "least fall of the cost (Eq. 2, one reference per leaf) that is worth another iteration",
     "Meister and Bittner 2022, released framework"},
    {"sparsity", double(PrbvhConfig{}.sparsity), 1.0, 64.0, true, "nodes",
     "one pair of siblings in so many searches in an iteration; decreases as the build converges",
     "Meister and Bittner 2018b, section 3.4; 1 in the released framework"},
    {"lock_rounds", double(PrbvhConfig{}.lock_rounds), 1.0, 64.0, true, "rounds",
     "attempts at the locks per search; later ones are for nodes that lost to losers only",
     "ours: fewer iterations and lower cost; the paper's is 1"},
}};

template <std::size_t A, std::size_t B>
constexpr std::array<ParameterInfo, A + B> join(const std::array<ParameterInfo, A>& first,
                                                const std::array<ParameterInfo, B>& second) {
    std::array<ParameterInfo, A + B> all{};
    for (std::size_t i = 0; i < A; ++i) all[i] = first[i];
    for (std::size_t i = 0; i < B; ++i) all[A + i] = second[i];
    return all;
}

inline constexpr auto prbvh_s_parameters = join(prbvh_parameters, sbvh_parameters);

/// The settings in checked parameters (check_parameters).
PrbvhConfig prbvh_config(const Parameters& parameters);

/// Hill climbing from `base`; `clock` has run since the build began. `leaf_cost` is as in
/// ReinsertionOptimiser. Throws Cancelled.
BinaryBvh climb(const BinaryBvh& base, const CostModel& model, const PrbvhConfig& config,
                const Stopwatch& clock, Token& token, BuildLog& log, double leaf_cost = 0.0);

/// Parallel reinsertion (Meister and Bittner 2018b): in each iteration every node searches for its
/// best new position in the whole tree, and those moves are made that win all their locks, until
/// the cost hardly changes. Ours: once few nodes move, iterations in which only nodes near them
/// search come between (ReinsertionOptimiser::climb). The base is build_lbvh's tree.
///
/// Returns the best tree it came by, numbered depth-first; with a time limit the tree depends on
/// the speed of the machine, else it is the same for any thread count. Throws Cancelled.
BinaryBvh build_prbvh(const Mesh& mesh, const CostModel& model, const PrbvhConfig& config,
                      Token& token, BuildLog& log);

/// The same from build_sbvh's tree, as it is: below nodes of max_leaf_size references object splits
/// go on to single ones. Spatial splits down to single references (max_leaf_size 1, the released
/// framework's base) give a higher cost: the collapse charges the parts of a triangle one by one.
BinaryBvh build_prbvh_s(const Mesh& mesh, const CostModel& model, const SbvhConfig& base,
                        const PrbvhConfig& config, Token& token, BuildLog& log);

}  // namespace bvhlab
