// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// Turns a binary tree of single references into a tree of branching factor `branching` (2, 4 or 8)
/// with adaptive leaf sizes and least cost: the dynamic programme of Ylitie, Karras, Laine 2017,
/// section 3.1, with Eq. 2 (binary) or Eq. 3 (wide) as cost, then the breadth-first layout.
Bvh collapse(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, unsigned branching,
             const CostModel& model, Token& token);

/// The same for compressed 8-wide nodes (compressed_bvh.h): leaves have at most three references,
/// and Eq. 3 charges each reference as one test. Costs are those of the boxes before they are
/// quantised.
Bvh compress(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, const CostModel& model,
             Token& token);

}  // namespace bvhlab
