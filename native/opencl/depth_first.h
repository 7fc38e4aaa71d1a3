// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// bvh/depth_first.h on a device: the same tree, node for node, for a tree of any depth. Waits a
/// few times; goes on with the caller's stage.
DeviceBinary depth_first(Commands& commands, const DeviceBinary& bvh);

}  // namespace bvhlab::opencl
