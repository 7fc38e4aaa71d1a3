// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Linear BVH (Lauterbach et al. 2009) with the topology of Karras 2012: triangles sorted by the
/// 60-bit Morton code of their box centres, each node split where the highest differing bit of its
/// codes changes. Equal codes are told apart by their place in the sorted order, so depth is at
/// most 60 + 28.
///
/// Interior nodes come in depth-first order and leaves in sorted order. Throws Cancelled.
BinaryBvh build_lbvh(const Mesh& mesh, Token& token);

}  // namespace bvhlab
