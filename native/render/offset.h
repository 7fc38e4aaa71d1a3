// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "scene/mesh.h"

namespace bvhlab {

/// Where a ray met a surface, and how far a new ray must start from it.
struct SurfacePoint {
    glm::dvec3 position;  ///< on the original triangle
    glm::dvec3 normal;    ///< geometric, unit length, on the side that the ray came from
    double clearance;     ///< distance along the normal that new origins keep, see surface_point()
    bool inside;          ///< the ray came from where the winding is clockwise
};

/// The hit point from barycentrics, in double.
///
/// The clearance follows the idea of Wächter & Binder 2019 ("A Fast and Robust Method for Avoiding
/// Self-Intersection"): to move by a fixed number of units in the last place. With u = 2^-24,
/// normal n and position p it is 2u sum |n_i p_i| + 32u max |corner - p|. Rounding the moved point
/// to float shifts it along n by at most u sum |n_i p_i|, so it stays on its side of the plane,
/// where a hit decided in double (trace/intersect.h) cannot see the triangle; the second term,
/// larger than the error of a single-precision test on a well-shaped triangle, is for other tracers
/// of the same rays. Both scale with the scene: there is no length constant.
inline SurfacePoint surface_point(const Triangle& triangle, double u, double v,
                                  const glm::dvec3& ray_direction) {
    constexpr double unit_roundoff = 0x1p-24;
    const glm::dvec3 a(triangle.a), b(triangle.b), c(triangle.c);
    SurfacePoint point;
    point.position = (1.0 - u - v) * a + u * b + v * c;

    // Needles may have a cross product of zero length; any normal towards the viewer will do for
    // them.
    const glm::dvec3 cross = glm::cross(b - a, c - a);
    const double length = glm::length(cross);
    point.normal = length > 0.0 ? cross / length : -glm::normalize(ray_direction);
    point.inside = glm::dot(point.normal, ray_direction) > 0.0;
    if (point.inside) point.normal = -point.normal;

    double largest = 0.0;
    for (const glm::dvec3& corner : {a, b, c}) {
        const glm::dvec3 distance = glm::abs(corner - point.position);
        largest = std::max({largest, distance.x, distance.y, distance.z});
    }
    const double rounding = glm::dot(glm::abs(point.normal), glm::abs(point.position));
    point.clearance = unit_roundoff * (2.0 * rounding + 32.0 * largest);
    return point;
}

/// Origin, rounded to float, of a ray that leaves the surface towards `direction` (any length).
inline glm::vec3 offset_origin(const SurfacePoint& point, const glm::dvec3& direction) {
    const double side = glm::dot(point.normal, direction) >= 0.0 ? 1.0 : -1.0;
    return glm::vec3(point.position + side * point.clearance * point.normal);
}

}  // namespace bvhlab
