// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/prbvh_a.h"

#include <cmath>
#include <numbers>

#include "build/lbvh.h"
#include "build/reinsertion_optimiser.h"
#include "build/reinsertion_schedule.h"

namespace bvhlab {
namespace {

BinaryBvh anneal(const BinaryBvh& base, const CostModel& model, const AnnealingConfig& config,
                 const Stopwatch& clock, Token& token, BuildLog& log) {
    ReinsertionOptimiser optimiser(base, model, clock, token, log);
    Annealing(optimiser, config, clock, token).run(log);
    BinaryBvh best = optimiser.best();
    token.advance(1.0F);
    return best;
}

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
    return anneal(base, model, config, clock, token, log);
}

BinaryBvh build_prbvh_sa(const Mesh& mesh, const CostModel& model, const SbvhConfig& base_config,
                         const AnnealingConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_sbvh(mesh, model, base_config, token);
    token.begin("building PRBVH_SA");
    return anneal(base, model, config, clock, token, log);
}

}  // namespace bvhlab
