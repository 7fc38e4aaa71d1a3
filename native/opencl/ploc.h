// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "build/ploc.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// build/ploc.h on a device: the same tree, node for node. Waits once in each iteration.
/// Throws Cancelled, Error.
DeviceBinary build_ploc(Commands& commands, const DeviceMesh& mesh, const PlocConfig& config,
                        Token& token);

}  // namespace bvhlab::opencl
