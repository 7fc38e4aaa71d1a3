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

inline constexpr double unit_roundoff = 0x1p-24;  ///< of float: u below

/// Shadow rays end this times (the size of the light's coordinates + the length of the way) off the
/// plane of a lamp or emitting triangle, so that neither it nor what lies in that plane hides it:
/// rounding the ray's direction moves its end by at most u times the way, and rounding moves
/// geometry that was made to lie in the plane by at most u times its coordinates.
inline constexpr double end_clearance = 2.0 * unit_roundoff;

/// `weights` of the corners (the sum is 1), each raised to at least `least` <= 1/3, at the cost of
/// the others in proportion to what they have to spare. Continuous; points that are not near an
/// edge stay where they are.
inline glm::dvec3 inset(const glm::dvec3& weights, double least) {
    const glm::dvec3 spare = glm::max(weights - least, 0.0);
    const double sum = spare.x + spare.y + spare.z;
    return sum > 0.0 ? least + spare * ((1.0 - 3.0 * least) / sum) : glm::dvec3(1.0 / 3.0);
}

/// The hit point from barycentrics, in double, and its clearance c: an origin that is rounded to
/// float at position + c * normal must lie above its triangle, and on this side of the walls that
/// meet it at its edges. With u = 2^-24, position p, unit normal n, L the longest side and A the
/// area of the triangle:
///
/// - Above. Rounding moves coordinate i by at most u |p_i + c n_i| + 2^-150 (the latter where
///   floats are denormal), thus the origin along n by at most u sum |n_i p_i| + u c + 2^-149.
/// - Seen to be above. A ray that leaves the plane at the angle whose sine is s would have to meet
///   it at t = -h / s, h the height of its origin. Triangles are met as decided exactly
///   (trace/intersect.h), but t is computed from edge functions of about 2 A s, whose errors are
///   within 2^-48 L^2, so that t has the sign of the exact one if h > 2^-48 L^3 / (2 A s) * s. That
///   is 2^-48 L times the aspect L^2 / (2 A), which counts up to 2^27: thinner ones are not held.
/// - Other tracers of the same rays decide in float, with errors of about u L. The term 4 u L is
///   for them: Möller & Trumbore's test then has no self-hit on well-shaped triangles.
///
/// So c = u (2 sum |n_i p_i| + 4 L) + 2^-46 L * aspect + 2^-148, as in Wächter & Binder 2019 ("A
/// Fast and Robust Method for Avoiding Self-Intersection") some units in the last place.
///
/// - Walls. Rounding moves the origin sideways, too, by up to u |p|, and u and v themselves are
///   rounded: near an edge it could come to lie beyond the wall that meets the triangle there, out
///   of a closed room. So points keep the distance c + 2 u |p| from the edges: walls that lean over
///   the triangle by up to 45 degrees are not passed. Triangles that are smaller than that are
///   left from their middle.
///
/// All scale with the scene: there is no length constant.
inline SurfacePoint surface_point(const Triangle& triangle, double u, double v,
                                  const glm::dvec3& ray_direction) {
    constexpr double denormal = 0x1p-148, most_aspect = 0x1p27;
    const glm::dvec3 a(triangle.a), b(triangle.b), c(triangle.c);
    glm::dvec3 weights(1.0 - u - v, u, v);
    SurfacePoint point;
    point.position = weights.x * a + weights.y * b + weights.z * c;

    // Needles may have a cross product of zero length; any normal towards the viewer will do for
    // them.
    const glm::dvec3 ab = b - a, ac = c - a, bc = c - b;
    const glm::dvec3 cross = glm::cross(ab, ac);
    const double length = glm::length(cross);
    point.normal = length > 0.0 ? cross / length : -glm::normalize(ray_direction);
    point.inside = glm::dot(point.normal, ray_direction) > 0.0;
    if (point.inside) point.normal = -point.normal;

    const double squared = std::max({glm::dot(ab, ab), glm::dot(ac, ac), glm::dot(bc, bc)});
    const double longest = std::sqrt(squared);
    const double aspect = squared < most_aspect * length ? squared / length : most_aspect;
    const double rounding = glm::dot(glm::abs(point.normal), glm::abs(point.position));
    point.clearance =
        unit_roundoff * (2.0 * rounding + 4.0 * longest) + 0x1p-46 * longest * aspect + denormal;

    // The distance from an edge is the weight of the corner across times 2 A / (that edge).
    const double margin = point.clearance + 2.0 * unit_roundoff * glm::length(point.position);
    const double least = 3.0 * margin * longest < length ? margin * longest / length : 1.0 / 3.0;
    if (std::min({weights.x, weights.y, weights.z}) < least) {
        weights = inset(weights, least);
        point.position = weights.x * a + weights.y * b + weights.z * c;
    }
    return point;
}

/// Origin, rounded to float, of a ray that leaves the surface towards `direction` (any length).
inline glm::vec3 offset_origin(const SurfacePoint& point, const glm::dvec3& direction) {
    const double side = glm::dot(point.normal, direction) >= 0.0 ? 1.0 : -1.0;
    return glm::vec3(point.position + side * point.clearance * point.normal);
}

}  // namespace bvhlab
