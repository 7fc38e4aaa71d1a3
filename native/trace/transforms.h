// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "base/token.h"
#include "bvh/wide_bvh.h"
#include "trace/trace.h"

namespace bvhlab {

/// Rows of the inverse of [b - a, c - a, n, a], n the unit normal: they give a point's u, v and
/// height above the triangle's plane. Woop 2004; stored as by Aila, Laine 2009, the height first.
inline constexpr std::size_t woop_affine_floats = 12;

/// The same with a coordinate axis for n (Baldwin, Weber 2016): the axis along which the normal is
/// longest. Of each row one coefficient is then 0 (u, v) or 1 (height) and not stored. With x, y, z
/// for that axis and the two that follow it:
///     [0..2] coefficients of y, z and the constant of the height
///     [3..5], [6..8] coefficients of y, z and the constant of u and of v
///     [9] the axis, an int32
inline constexpr std::size_t baldwin_weber_floats = 10;

/// Floats that `test` reads of a triangle in place of its corners; 0 where it reads the corners.
std::size_t transform_floats(TriangleTest test);

/// The transforms that `test` needs of a tree's triangles, kept in `bvh.transforms`; null for tests
/// on the corners. Computed in double and rounded once. A triangle without area, or whose transform
/// overflows float, gets one of NaN, with which no comparison holds: it is never hit. Throws
/// Cancelled.
std::shared_ptr<const TriangleTransforms> triangle_transforms(const Bvh& bvh, TriangleTest test,
                                                              const Token& token);

}  // namespace bvhlab
