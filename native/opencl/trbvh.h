// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.h"
#include "base/token.h"
#include "build/trbvh.h"
#include "opencl/commands.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// bvhlab::build_trbvh on the device: the same tree, node for node, unless the time limit ends the
/// build. Throws as Commands.
DeviceBinary build_trbvh(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                         const TrbvhConfig& config, Token& token, BuildLog& log);

/// Its passes, over a tree of one reference per leaf; leaves the nodes in no particular order.
/// `watch` was started with the build.
void restructure(Commands& commands, DeviceBinary& bvh, const CostModel& model,
                 const TrbvhConfig& config, const Stopwatch& watch, Token& token, BuildLog& log);

}  // namespace bvhlab::opencl
