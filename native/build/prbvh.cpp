// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/prbvh.h"

#include <algorithm>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "build/reinsertion_optimiser.h"

namespace bvhlab {

BinaryBvh climb(const BinaryBvh& base, const CostModel& model, const PrbvhConfig& config,
                const Stopwatch& clock, Token& token, BuildLog& log, double leaf_cost) {
    ReinsertionOptimiser optimiser(base, model, clock, token, log, leaf_cost);
    const auto limit = std::uint32_t(config.iterations);
    auto sparsity = std::uint32_t(config.sparsity);
    log.ended = "iteration limit";
    for (std::uint32_t i = 1; i <= limit; ++i) {
        const bool at_rest = optimiser.climb(i, sparsity, config.lock_rounds, config.threshold);
        token.advance(float(i) / float(std::max(limit, i + 1)));
        if (at_rest && sparsity == 1) {
            log.ended = "converged";
            break;
        }
        if (at_rest) --sparsity;
        if (config.max_seconds > 0.0 && clock.seconds() >= config.max_seconds) {
            log.ended = "time limit";
            break;
        }
    }
    BinaryBvh best = optimiser.best();
    token.advance(1.0F);
    return best;
}

PrbvhConfig prbvh_config(const Parameters& parameters) {
    const auto value = [&](std::string_view name) { return parameters.find(name)->second; };
    return {.iterations = int(value("iterations")),
            .max_seconds = value("max_seconds"),
            .threshold = value("threshold"),
            .sparsity = int(value("sparsity")),
            .lock_rounds = int(value("lock_rounds"))};
}

BinaryBvh build_prbvh(const Mesh& mesh, const CostModel& model, const PrbvhConfig& config,
                      Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_lbvh(mesh, token);
    token.begin("building PRBVH");
    return climb(base, model, config, clock, token, log);
}

BinaryBvh build_prbvh_s(const Mesh& mesh, const CostModel& model, const SbvhConfig& base_config,
                        const PrbvhConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const BinaryBvh base = build_sbvh(mesh, model, base_config, token);
    token.begin("building PRBVH_S");
    return climb(base, model, config, clock, token, log);
}

}  // namespace bvhlab
