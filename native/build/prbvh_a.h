// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "build/prbvh.h"

namespace bvhlab {

/// Settings of the annealing builders; the defaults are the paper's where it has them.
struct AnnealingConfig {
    int iterations = 3000;
    int period = 50;
    double max_temperature = 1.0;
    double prune_probability = 0.01;
    int heated_sparsity = 16;
    double max_seconds = 0.0;
    double threshold = 0.01;
    int lock_rounds = 3;
    std::uint64_t seed = 1;
};

inline constexpr std::array<ParameterInfo, 9> prbvh_a_parameters{{
    {"iterations", double(AnnealingConfig{}.iterations), 0.0, 1e6, true, "iterations",
     "I of Eq. 5; cold ones that would change nothing are left out, and some until it converges "
     "follow",
     "Meister and Bittner 2022, section 4"},
    {"period", double(AnnealingConfig{}.period), 2.0, 1e6, true, "iterations",
     "f of Eq. 5: the first half of each period is cold, the second is heated",
     "Meister and Bittner 2022, section 4"},
    {"max_temperature", AnnealingConfig{}.max_temperature, 0.0, 1e6, false,
     "surface area where the scene's longest side is 1", "T_max of Eq. 5",
     "Meister and Bittner 2022, section 4"},
    {"prune_probability", AnnealingConfig{}.prune_probability, 0.0, 1.0, false, "probability",
     "limit on that of entering a subtree that cannot beat the best position seen",
     "Meister and Bittner 2022, section 4"},
    {"heated_sparsity", double(AnnealingConfig{}.heated_sparsity), 1.0, 1e6, true, "nodes",
     "one node in so many, at random, searches in a heated iteration",
     "ours: faster, and more of the moves are made; the paper's is 1"},
    {"max_seconds", AnnealingConfig{}.max_seconds, 0.0, 1e6, false, "seconds",
     "limit on the build time, looked at after each iteration; 0 for none",
     "ours; the paper has no limit"},
    {"threshold", AnnealingConfig{}.threshold, 0.0, 1e6, false, "cost",
     "least fall of the cost that is worth another iteration in a cold half period",
     "Meister and Bittner 2022, released framework"},
    {"lock_rounds", double(AnnealingConfig{}.lock_rounds), 1.0, 64.0, true, "rounds",
     "attempts at the locks per search; later ones are for nodes that lost to losers only",
     "ours: fewer iterations and lower cost; the paper's is 1"},
    {"seed", double(AnnealingConfig{}.seed), 0.0, 4294967295.0, true, "", "of the random numbers",
     "ours"},
}};

inline constexpr auto prbvh_sa_parameters = join(prbvh_a_parameters, sbvh_parameters);

/// The settings in checked parameters (check_parameters).
AnnealingConfig annealing_config(const Parameters& parameters);

/// Eq. 5: the temperature of an iteration, 0 .. iterations - 1, in units of surface area of the
/// scene scaled to longest side 1.
double temperature(const AnnealingConfig& config, int iteration);

/// Parallel reinsertion with simulated annealing (Meister and Bittner 2022, section 2.2): periods
/// of hill climbing, as build_prbvh, and of heating, in which reinsertions that enlarge the tree
/// are accepted with the probability of Eq. 4.
///
/// Returns the best tree it came by, numbered depth-first. Since the first half period is hill
/// climbing and the last iterations are too, it costs no more than build_prbvh's where that
/// converges within half a period. With a time limit the tree depends on the speed of the machine,
/// else it is the same for any thread count. Throws Cancelled.
BinaryBvh build_prbvh_a(const Mesh& mesh, const CostModel& model, const AnnealingConfig& config,
                        Token& token, BuildLog& log);

/// The same from build_sbvh's tree, split to single references.
BinaryBvh build_prbvh_sa(const Mesh& mesh, const CostModel& model, const SbvhConfig& base,
                         const AnnealingConfig& config, Token& token, BuildLog& log);

}  // namespace bvhlab
