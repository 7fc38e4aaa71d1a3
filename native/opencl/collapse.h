// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "base/token.h"
#include "bvh/cost.h"
#include "bvh/wide_bvh.h"
#include "opencl/commands.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// bvh/collapse.h on the device: stages "collapsing" and "layout". `device_mesh` is a copy of
/// `mesh`, and the nodes of `binary` may stand in any order. The result is the host's, byte for
/// byte.
///
/// Throws Cancelled, Error and MemoryError; std::length_error for more than 2^28 references and
/// std::invalid_argument for another branching factor than 2, 4 or 8.
Bvh collapse(Commands& commands, const DeviceBinary& binary, std::shared_ptr<const Mesh> mesh,
             const DeviceMesh& device_mesh, unsigned branching, const CostModel& model,
             Token& token);

/// The same for compressed 8-wide nodes.
Bvh compress(Commands& commands, const DeviceBinary& binary, std::shared_ptr<const Mesh> mesh,
             const DeviceMesh& device_mesh, const CostModel& model, Token& token);

}  // namespace bvhlab::opencl
