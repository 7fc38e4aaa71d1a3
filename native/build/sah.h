// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Full sweep (Wald 2007, section 3): top-down, each node divided where the surface area heuristic
/// is least over all places in the orders of the box centres on three axes, down to single
/// references. The orders are sorted once and divided stably from then on.
///
/// The division does not depend on the constants of `model`: these decide on leaves, in the
/// collapse. Nodes are numbered depth-first; the tree is the same for any thread count. Throws
/// Cancelled.
BinaryBvh build_sah(const Mesh& mesh, const CostModel& model, Token& token);

}  // namespace bvhlab
