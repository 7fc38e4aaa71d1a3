// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "build/hlbvh.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// build/hlbvh.h on a device: the same tree, node for node. Waits once for each level above the
/// clusters. Throws Cancelled, Error.
DeviceBinary build_hlbvh(Commands& commands, const DeviceMesh& mesh, const HlbvhConfig& config,
                         Token& token);

}  // namespace bvhlab::opencl
