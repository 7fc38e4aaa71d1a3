// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/parallel.h"
#include "base/token.h"
#include "build/build_log.h"
#include "build/prbvh.h"
#include "build/prbvh_a.h"

namespace bvhlab {

// Which iterations a reinsertion optimiser runs, the CPU's or a device's, and when it ends.

/// Whether the time is over that a builder may take.
inline bool time_is_over(double max_seconds, const Stopwatch& clock) {
    return max_seconds > 0.0 && clock.seconds() >= max_seconds;
}

/// Hill climbing until it rests (Meister and Bittner 2018b): fewer and fewer nodes are left out.
template <class Optimiser>
void run_climbing(Optimiser& optimiser, const PrbvhConfig& config, const Stopwatch& clock,
                  Token& token, BuildLog& log) {
    const auto limit = std::uint32_t(config.iterations);
    auto sparsity = std::uint32_t(config.sparsity);
    log.ended = "iteration limit";
    for (std::uint32_t i = 1; i <= limit; ++i) {
        const bool at_rest = optimiser.climb(i, sparsity, config.lock_rounds, config.threshold);
        token.advance(float(i) / float(std::max(limit, i + 1)));
        if (at_rest && sparsity == 1) {
            log.ended = "converged";
            return;
        }
        if (at_rest) --sparsity;
        if (time_is_over(config.max_seconds, clock)) {
            log.ended = "time limit";
            return;
        }
    }
}

/// Simulated annealing (paper, section 2.2), then hill climbing until it rests.
template <class Optimiser>
class Annealing {
public:
    Annealing(Optimiser& optimiser, const AnnealingConfig& config, const Stopwatch& clock,
              Token& token)
        : optimiser_(optimiser), config_(config), clock_(clock), token_(token) {}

    void run(BuildLog& log) {
        log.ended = anneal() && climb_to_rest() ? "converged" : "time limit";
    }

private:
    /// The schedule of Eq. 5. Returns false once the time is over.
    bool anneal() {
        bool at_rest = false;  // so that the rest of a cold half period would change nothing
        for (int i = 0; i < config_.iterations; ++i) {
            const double heat = temperature(config_, i);
            if (heat > 0.0) {
                optimiser_.heat({.temperature = float(0.5 * heat),
                                 .prune_probability = float(config_.prune_probability),
                                 .seed = config_.seed,
                                 .iteration = std::uint64_t(i) + 1},
                                std::uint32_t(config_.heated_sparsity), config_.lock_rounds);
                at_rest = false;
            } else if (!at_rest) {
                at_rest = climb(i);
            }
            token_.advance(float(i + 1) / float(config_.iterations + 10));
            if (time_is_over(config_.max_seconds, clock_)) return false;
        }
        return true;
    }

    /// What is left to gain after the last heating. Returns false once the time is over.
    bool climb_to_rest() {
        for (int i = config_.iterations; !climb(i); ++i)
            if (time_is_over(config_.max_seconds, clock_)) return false;
        return true;
    }

    /// One cold iteration. Returns whether it changed next to nothing.
    bool climb(int iteration) {
        return optimiser_.climb(std::uint32_t(iteration) + 1, 1, config_.lock_rounds,
                                config_.threshold);
    }

    Optimiser& optimiser_;
    const AnnealingConfig& config_;
    const Stopwatch& clock_;
    Token& token_;
};

}  // namespace bvhlab
