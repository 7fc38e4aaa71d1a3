// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.h"
#include "build/build_log.h"
#include "build/prbvh.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// Hill climbing by parallel reinsertion from `base`; `clock` has run since the build began. Same
/// tree, log and end as bvhlab::climb, but for times. Throws as Commands does.
DeviceBinary climb(Commands& commands, const DeviceBinary& base, const CostModel& model,
                   const PrbvhConfig& config, const Stopwatch& clock, Token& token, BuildLog& log);

/// bvhlab::build_prbvh on a device, its base too. With a time limit the tree depends on the speed
/// of the device, else it is the host's, node for node. Throws as Commands does.
DeviceBinary build_prbvh(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                         const PrbvhConfig& config, Token& token, BuildLog& log);

/// The same from build_sbvh's tree, which is made on the host, as in the paper.
DeviceBinary build_prbvh_s(Commands& commands, const Mesh& mesh, const CostModel& model,
                           const SbvhConfig& base, const PrbvhConfig& config, Token& token,
                           BuildLog& log);

}  // namespace bvhlab::opencl
