// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/prbvh.h"

#include "build/reinsertion_schedule.h"
#include "opencl/lbvh.h"
#include "opencl/reinsertion_optimiser.h"

namespace bvhlab::opencl {

DeviceBinary climb(Commands& commands, const DeviceBinary& base, const CostModel& model,
                   const PrbvhConfig& config, const Stopwatch& clock, Token& token, BuildLog& log) {
    ReinsertionOptimiser optimiser(commands, base, model, clock, token, log);
    run_climbing(optimiser, config, clock, token, log);
    DeviceBinary best = optimiser.best();
    token.advance(1.0F);
    return best;
}

DeviceBinary build_prbvh(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                         const PrbvhConfig& config, Token& token, BuildLog& log) {
    const Stopwatch clock;
    const DeviceBinary base = build_lbvh(commands, mesh, token);
    token.begin("building PRBVH");
    return climb(commands, base, model, config, clock, token, log);
}

DeviceBinary build_prbvh_s(Commands& commands, const Mesh& mesh, const CostModel& model,
                           const SbvhConfig& base_config, const PrbvhConfig& config, Token& token,
                           BuildLog& log) {
    const Stopwatch clock;
    const DeviceBinary base = upload(commands, build_sbvh(mesh, model, base_config, token));
    token.begin("building PRBVH_S");
    return climb(commands, base, model, config, clock, token, log);
}

}  // namespace bvhlab::opencl
