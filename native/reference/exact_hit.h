// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/exact_sum.h"
#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

/// Where a ray crosses the plane of a triangle: t = numerator / determinant, both exact.
struct Crossing {
    ExactSum
        numerator;  ///< volume of the corners as seen from the origin, det(a - o, b - o, c - o)
    ExactSum determinant;  ///< direction . normal; never 0
    double t;              ///< the quotient, within 4 units in the last place
};

/// Whether the ray's line meets the closed triangle, decided exactly: edges and corners are inside,
/// so that a closed mesh has no gaps. From the signs of the three volumes that the direction spans
/// with the edges (Pluecker coordinates; Kensler and Shirley 2006, section 2), in double with an
/// error bound, and without rounding where a volume is within its bound of 0. A triangle without
/// area and a ray in the triangle's plane never meet.
bool line_meets(const Ray& ray, const Triangle& triangle);

/// Bounds that t of a line that meets the triangle is within, in double and quick: most triangles
/// are behind the ray or beyond its nearest hit.
struct Bounds {
    double low, high;
};
Bounds bounds_of_t(const Ray& ray, const Triangle& triangle);

/// The crossing of a line that meets the triangle.
Crossing crossing(const Ray& ray, const Triangle& triangle);

/// Whether t_min <= t <= t_max, exactly.
bool in_interval(const Crossing& crossing, const Ray& ray);

/// Whether t of `a` is smaller than t of `b`, exactly.
bool nearer(const Crossing& a, const Crossing& b);

/// The hit with u and v within 4 units in the last place of their own.
HitOf<double> make_hit(const Ray& ray, const Triangle& triangle, std::uint32_t index,
                       const Crossing& crossing);

}  // namespace bvhlab
