// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/prbvh.h"

#include "build/lbvh.h"
#include "build/reinsertion_optimiser.h"
#include "build/reinsertion_schedule.h"

namespace bvhlab {

BinaryBvh climb(const BinaryBvh& base, const CostModel& model, const PrbvhConfig& config,
                const Stopwatch& clock, Token& token, BuildLog& log, double leaf_cost) {
    ReinsertionOptimiser optimiser(base, model, clock, token, log, leaf_cost);
    run_climbing(optimiser, config, clock, token, log);
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
