// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/prbvh_a.h"

#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "build/reinsertion_optimiser.h"

namespace bvhlab {
namespace {

class Annealing {
public:
    Annealing(const BinaryBvh& base, const CostModel& model, const AnnealingConfig& config,
              const Stopwatch& clock, Token& token, BuildLog& log)
        : config_(config),
          clock_(clock),
          token_(token),
          log_(log),
          optimiser_(base, model, clock, token, log) {}

    BinaryBvh run() {
        log_.ended = "converged";
        if (!anneal() || !climb_to_rest()) log_.ended = "time limit";
        BinaryBvh best = optimiser_.best();
        token_.advance(1.0F);
        return best;
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

    /// One cold iteration. Returns whether it changed next to nothing.
    bool climb(int iteration) {
        return optimiser_.climb(std::uint32_t(iteration) + 1, 1, config_.lock_rounds,
                                config_.threshold);
    }

    bool time_is_over() const {
        return config_.max_seconds > 0.0 && clock_.seconds() >= config_.max_seconds;
    }

    const AnnealingConfig& config_;
    const Stopwatch& clock_;
    Token& token_;
    BuildLog& log_;
    ReinsertionOptimiser optimiser_;
};

}  // namespace

double temperature(const AnnealingConfig& config, int iteration) {
    const int phase = iteration % config.period;  // exact, where the sine of i f would not be
    if (2 * phase <= config.period) return 0.0;
    const double wave = -std::sin(2.0 * std::numbers::pi * phase / config.period);
    return wave * config.max_temperature * double(config.iterations - iteration) /
           double(config.iterations);
}

AnnealingConfig annealing_config(const Parameters& parameters) {
    const auto value = [&](std::string_view name) { return parameters.find(name)->second; };
    return {.iterations = int(value("iterations")),
            .period = int(value("period")),
            .max_temperature = value("max_temperature"),
            .prune_probability = value("prune_probability"),
            .heated_sparsity = int(value("heated_sparsity")),
            .max_seconds = value("max_seconds"),
            .threshold = value("threshold"),
            .lock_rounds = int(value("lock_rounds")),
            .seed = std::uint64_t(value("seed"))};
}

BinaryBvh build_prbvh_a(const Mesh& mesh, const CostModel& model, const AnnealingConfig& config,
                        Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_lbvh(mesh, token);
    token.begin("building PRBVH_A");
    return Annealing(base, model, config, clock, token, log).run();
}

BinaryBvh build_prbvh_sa(const Mesh& mesh, const CostModel& model, const SbvhConfig& base_config,
                         const AnnealingConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_sbvh(mesh, model, base_config, token);
    token.begin("building PRBVH_SA");
    return Annealing(base, model, config, clock, token, log).run();
}

}  // namespace bvhlab
