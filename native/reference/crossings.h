// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "base/array.h"
#include "base/token.h"
#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

/// Where lines cross given triangles, by ray: what an answer of a tracer is measured by.
///
/// Where direction . normal is 0 (a triangle without area, or one that the line runs beside) there
/// is no crossing: t, u and v are NaN, `margin` is -infinity, `condition` infinity.
struct Crossings {
    Array<std::uint8_t> meets;  ///< 1 where the line meets the closed triangle: exact
    Array<double> t, u, v;      ///< of the line and the triangle's plane, within 4 units of their
                                ///< last places
    Array<double> margin;       ///< least of 1 - u - v, u and v: below 0 outside
    Array<double> condition;    ///< of t = n / d, see crossings()
};

/// The crossing of each ray's line with the triangle of that index; t_min and t_max do not count.
///
/// `condition` is by how much rounding is magnified when t is computed as the quotient of
/// n = det(a - o, b - o, c - o) and d, the sum of det(direction, p - o, q - o) over the edges: the
/// sum of the |products| that n consists of over |n|, plus the same for d. Arithmetic with relative
/// error e gets t within a small multiple of condition * e. It does not ask how t changes with the
/// ray or the triangle: they are given numbers, and exact. Infinite where n is 0.
///
/// `triangles` has an index below mesh.size() for each ray. `threads` 0 means all. Throws
/// Cancelled.
Crossings crossings(const Mesh& mesh, const RayBatch& rays,
                    std::span<const std::uint32_t> triangles, int threads, Token& token);

/// By ray: 1 where its line meets both triangles and at the same t, without any rounding.
Array<std::uint8_t> exact_ties(const Mesh& mesh, const RayBatch& rays,
                               std::span<const std::uint32_t> first,
                               std::span<const std::uint32_t> second, int threads, Token& token);

}  // namespace bvhlab
