// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/array.h"
#include "base/token.h"
#include "scene/mesh.h"

namespace bvhlab {

/// The triangles of a mesh along the Morton curve, where LBVH, HLBVH and PLOC begin.
struct MortonOrder {
    Array<Box> boxes;                 ///< by triangle
    Array<std::uint64_t> codes;       ///< 60 bits, ascending, by place
    Array<std::uint32_t> references;  ///< triangle by place; equal codes in the order of the mesh
};

/// Sorts the triangles by the Morton code of their box centres (morton.h). Throws Cancelled.
MortonOrder morton_order(const Mesh& mesh, const Token& token);

}  // namespace bvhlab
