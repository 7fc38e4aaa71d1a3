// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.h"
#include "build/build_log.h"
#include "build/prbvh_a.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// Parallel reinsertion with simulated annealing from `base`; `clock` has run since the build
/// began. Throws as Commands does.
DeviceBinary anneal(Commands& commands, const DeviceBinary& base, const CostModel& model,
                    const AnnealingConfig& config, const Stopwatch& clock, Token& token,
                    BuildLog& log);

/// bvhlab::build_prbvh_a on a device, its base too. With a time limit the tree depends on the speed
/// of the device. Else it is the same on every run and device, and the host's, node for node, as
/// long as no random number of 24 bits falls between the host's exponential, rounded by its own
/// library, and the correctly rounded one: once in 10^10 numbers by our estimate. Throws as
/// Commands does.
DeviceBinary build_prbvh_a(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                           const AnnealingConfig& config, Token& token, BuildLog& log);

/// The same from build_sbvh's tree, which is made on the host, as in the paper.
DeviceBinary build_prbvh_sa(Commands& commands, const Mesh& mesh, const CostModel& model,
                            const SbvhConfig& base, const AnnealingConfig& config, Token& token,
                            BuildLog& log);

}  // namespace bvhlab::opencl
