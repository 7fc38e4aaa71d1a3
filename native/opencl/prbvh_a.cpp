// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/prbvh_a.h"

#include "build/reinsertion_schedule.h"
#include "opencl/lbvh.h"
#include "opencl/reinsertion_optimiser.h"

namespace bvhlab::opencl {
DeviceBinary anneal(Commands& commands, const DeviceBinary& base, const CostModel& model,
                    const AnnealingConfig& config, const Stopwatch& clock, Token& token,
                    BuildLog& log) {
    ReinsertionOptimiser optimiser(commands, base, model, clock, token, log);
    Annealing(optimiser, config, clock, token).run(log);
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
