// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/prbvh_a.h"

#include "opencl/lbvh.h"
#include "opencl/reinsertion_optimiser.h"

namespace bvhlab::opencl {
namespace {

/// The schedule of build/prbvh_a.cpp.
class Annealing {
public:
    Annealing(ReinsertionOptimiser& optimiser, const AnnealingConfig& config,
              const Stopwatch& clock, Token& token)
        : optimiser_(optimiser), config_(config), clock_(clock), token_(token) {}

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
            if (time_is_over()) return false;
        }
        return true;
    }

    /// What is left to gain after the last heating. Returns false once the time is over.
    bool climb_to_rest() {
        for (int i = config_.iterations; !climb(i); ++i)
            if (time_is_over()) return false;
        return true;
    }

private:
    /// One cold iteration. Returns whether it changed next to nothing.
    bool climb(int iteration) {
        return optimiser_.climb(std::uint32_t(iteration) + 1, 1, config_.lock_rounds,
                                config_.threshold);
    }

    bool time_is_over() const {
        return config_.max_seconds > 0.0 && clock_.seconds() >= config_.max_seconds;
    }

    ReinsertionOptimiser& optimiser_;
    const AnnealingConfig& config_;
    const Stopwatch& clock_;
    Token& token_;
};

}  // namespace

DeviceBinary anneal(Commands& commands, const DeviceBinary& base, const CostModel& model,
                    const AnnealingConfig& config, const Stopwatch& clock, Token& token,
                    BuildLog& log) {
    ReinsertionOptimiser optimiser(commands, base, model, clock, token, log);
    Annealing annealing(optimiser, config, clock, token);
    log.ended = annealing.anneal() && annealing.climb_to_rest() ? "converged" : "time limit";
    DeviceBinary best = optimiser.best();
    token.advance(1.0F);
    return best;
}

DeviceBinary build_prbvh_a(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                           const AnnealingConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const DeviceBinary base = build_lbvh(commands, mesh, token);
    token.begin("building PRBVH_A");
    return anneal(commands, base, model, config, clock, token, log);
}

DeviceBinary build_prbvh_sa(Commands& commands, const Mesh& mesh, const CostModel& model,
                            const SbvhConfig& base_config, const AnnealingConfig& config,
                            Token& token, BuildLog& log) {
    const Stopwatch clock;
    const DeviceBinary base = upload(commands, build_sbvh(mesh, model, base_config, token));
    token.begin("building PRBVH_SA");
    return anneal(commands, base, model, config, clock, token, log);
}

}  // namespace bvhlab::opencl
