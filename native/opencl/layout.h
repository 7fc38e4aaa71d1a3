// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "bvh/wide_bvh.h"
#include "opencl/level_order.h"

namespace bvhlab::opencl {

/// bvh/layout.h's breadth-first layout of a planned tree on the device, copied to the host. Sets
/// all of the tree but its mesh.
Bvh breadth_first_layout(Commands& commands, const DeviceBinary& binary, Plans plans,
                         const DeviceMesh& mesh);

}  // namespace bvhlab::opencl
