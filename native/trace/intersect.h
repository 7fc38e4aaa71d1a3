// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

/// What a slab test subtracts from a box's planes and multiplies with.
struct Slabs {
    const glm::vec3 &near_origin, &far_origin;
    const glm::vec3 &near_inverse, &far_inverse;
};

/// How boxes and triangles are intersected, and why a hit depends on mesh and ray alone.
///
/// Whether the ray's line meets a triangle is *decided exactly*, as real arithmetic on the given
/// floats would, edges and corners included: nothing slips between two triangles that share an
/// edge. The test is the watertight one of Woop, Benthin, Wald 2013 on the original vertices, its
/// edge functions in double; one within its rounding error of 0 is evaluated without rounding. A
/// float version of the test runs first, over many triangles at once, and only discards triangles
/// whose edge functions differ in sign by more than their rounding errors; it never decides a hit.
///
/// Box tests are conservative (after Ize 2013), with u = 2^-24: the distance (plane - origin) *
/// inverse carries three roundings and the padded inverse a fourth, a relative error below 4.1 u.
/// Near planes use inverse * (1 - 8u) and far planes inverse * (1 + 8u), so for t >= 0 the computed
/// interval contains the exact one, with slack to spare for the rounding of the hit's own distance.
/// Rounding is monotone, so a larger box has a computed interval that contains the smaller one's.
///
/// Whether t_min <= t <= t_max is decided exactly, too, and t is within 1.5 units in the last place
/// of float: double arithmetic comes with a bound on its error (meets_triangle), and where that
/// does not do, t is the quotient of two numbers held without rounding. Two triangles whose t round
/// to the same float count as equally near, and the lower index is the answer.
///
/// The hit's distance is clamped to the computed interval of its triangle's *own box*, and a
/// triangle whose own box is missed is not hit. By monotony the ray then enters every box that
/// contains the triangle, at a distance not beyond the hit's: no tree can miss or cull it, and
/// which triangle is closest (ties: the lower index) is the same for all trees. Where a triangle
/// was split, its parts' boxes are padded so that the argument holds for one of them
/// (build/clip.h).
///
/// For boxes and distances, directions are scaled by a power of two so that the longest component
/// is in [1, 2); t is scaled with them. That keeps very long and very short directions away from
/// overflow. In a scene smaller than 2^-100 the longest component is in [2^-60, 2^-59) instead, so
/// that t is no denormal number. Small components may lose bits or vanish there; the exact decision
/// is taken on the direction as given.
///
/// What runs for each ray or candidate is inlined by force: it is compiled for the instructions of
/// each SIMD target then, not once for the oldest processor.
struct BoxRay {
    glm::vec3 origin;
    glm::vec3 given_direction;
    glm::vec3 direction;  ///< scaled
    float t_min, t_max;   ///< scaled, rounded outward
    double unscale;       ///< the caller's t = scaled t * unscale
    float reach;          ///< nothing of the scene is farther from the origin, along any axis
    int near_plane[3];    ///< row of WideNode::planes that the ray meets first, by axis
    int far_plane[3];
    glm::vec3 near_origin, far_origin;
    glm::vec3 near_inverse, far_inverse;

    /// `bounds` is the mesh's box: the same for all trees.
    BoxRay(const Ray& ray, const Box& bounds);

    Slabs slabs() const { return {near_origin, far_origin, near_inverse, far_inverse}; }
};

/// A ray as the default tests need it.
struct PreparedRay : BoxRay {
    int kx, ky, kz;          ///< kz: axis of the longest direction component
    float shear_x, shear_y;  ///< for the float filter
    float projection_error;  ///< bound on the float error of a projected coordinate
    double shear_xd, shear_yd, shear_zd;
    float given_t_min, given_t_max;
    double t_first, t_last;  ///< t_min and t_max scaled, exact

    PreparedRay(const Ray& ray, const Box& bounds);
};

/// 2^exponent for -1022 <= exponent <= 1023.
inline double power_of_two(int exponent) {
    return std::bit_cast<double>(std::uint64_t(exponent + 1023) << 52);
}

/// Floor of log2 of a positive normal number.
inline int exponent_of(double value) {
    return int(std::bit_cast<std::uint64_t>(value) >> 52) - 1023;
}

[[gnu::always_inline]] inline BoxRay::BoxRay(const Ray& ray, const Box& bounds)
    : origin(ray.origin), given_direction(ray.direction) {
    constexpr float u = 0x1p-24F;

    reach = 0.0F;
    for (int axis = 0; axis < 3; ++axis)
        reach = std::max({reach, std::abs(bounds.lower[axis] - origin[axis]),
                          std::abs(bounds.upper[axis] - origin[axis])});

    // Scale by a power of two.
    const glm::vec3 size = glm::abs(ray.direction);
    const float longest = std::max(size.x, std::max(size.y, size.z));
    const int exponent = exponent_of(double(longest)) + (reach < 0x1p-100F ? 60 : 0);
    const double scale = power_of_two(exponent);
    unscale = power_of_two(-exponent);
    for (int axis = 0; axis < 3; ++axis)
        direction[axis] = float(double(ray.direction[axis]) * unscale);
    constexpr float infinity = std::numeric_limits<float>::infinity();
    t_min = float(double(ray.t_min) * scale);
    if (double(t_min) > double(ray.t_min) * scale) t_min = std::nextafter(t_min, 0.0F);
    t_max = float(double(ray.t_max) * scale);
    if (double(t_max) < double(ray.t_max) * scale) t_max = std::nextafter(t_max, infinity);

    // Slabs. A component too small to invert is taken as parallel: it moves the ray by less than
    // 2^-39 of the scene's size. The origin is then moved inward by `nudge`, far more than that, so
    // that a ray in the plane of a face counts as inside, without 0 * infinity.
    constexpr float parallel = 0x1p-100F;
    constexpr float huge = 0x1p126F;
    for (int axis = 0; axis < 3; ++axis) {
        const bool negative = std::signbit(direction[axis]);
        near_plane[axis] = 2 * axis + (negative ? 1 : 0);
        far_plane[axis] = 2 * axis + (negative ? 0 : 1);
        near_origin[axis] = far_origin[axis] = origin[axis];
        if (std::abs(direction[axis]) < parallel) {
            const float nudge =
                std::max(4.0F * u * std::max(reach, std::abs(origin[axis])), 0x1p-120F);
            const float sign = negative ? -1.0F : 1.0F;
            near_origin[axis] += sign * nudge;
            far_origin[axis] -= sign * nudge;
            near_inverse[axis] = far_inverse[axis] = sign * huge;
        } else {
            const float inverse = 1.0F / direction[axis];
            near_inverse[axis] = inverse * (1.0F - 8.0F * u);
            far_inverse[axis] = inverse * (1.0F + 8.0F * u);
        }
    }
}

[[gnu::always_inline]] inline PreparedRay::PreparedRay(const Ray& ray, const Box& bounds)
    : BoxRay(ray, bounds) {
    // Shear along the longest axis.
    const glm::vec3 magnitude = glm::abs(direction);
    kz = magnitude.x >= magnitude.y ? (magnitude.x >= magnitude.z ? 0 : 2)
                                    : (magnitude.y >= magnitude.z ? 1 : 2);
    kx = (kz + 1) % 3;
    ky = (kz + 2) % 3;
    shear_zd = 1.0 / double(direction[kz]);
    shear_xd = double(given_direction[kx]) / double(given_direction[kz]);
    shear_yd = double(given_direction[ky]) / double(given_direction[kz]);
    shear_x = float(shear_xd);
    shear_y = float(shear_yd);
    projection_error = 8.0F * 0x1p-24F * reach;
    given_t_min = ray.t_min;
    given_t_max = ray.t_max;
    t_first = double(ray.t_min) / unscale;
    t_last = double(ray.t_max) / unscale;
}

/// Computed interval [near, far] in which the ray is inside a box; `planes` by row of
/// WideNode::planes.
[[gnu::always_inline]] inline void box_interval(const BoxRay& ray, const float (&planes)[6],
                                                float& near, float& far) {
    near = ray.t_min;
    far = ray.t_max;
    for (int axis = 0; axis < 3; ++axis) {
        near = std::max(
            near, (planes[ray.near_plane[axis]] - ray.near_origin[axis]) * ray.near_inverse[axis]);
        far = std::min(
            far, (planes[ray.far_plane[axis]] - ray.far_origin[axis]) * ray.far_inverse[axis]);
    }
}

/// Edge functions of a triangle: twice the signed areas that the ray spans with each edge once all
/// is sheared so that it runs along the z axis; weights of the corners a, b, c up to a common
/// factor.
struct EdgeFunctions {
    double a, b, c;
    double z[3];      ///< depths of the corners
    double bound;     ///< on the error of a, b and c
    double farthest;  ///< no corner is farther from the origin along any axis

    /// Whether the sign of one or another is not certain.
    bool is_vague() const {
        return std::abs(a) <= bound || std::abs(b) <= bound || std::abs(c) <= bound;
    }
    /// Whether signs that are certain differ: then the others do not matter.
    bool pass_by() const {
        return (a < -bound || b < -bound || c < -bound) && (a > bound || b > bound || c > bound);
    }
};

[[gnu::always_inline]] inline EdgeFunctions edge_functions(const PreparedRay& ray,
                                                           const float (&corners)[3][3]) {
    EdgeFunctions edges;
    double x[3], y[3], farthest = 0.0, largest = 0.0;
    for (int corner = 0; corner < 3; ++corner) {
        const double along_x = double(corners[corner][ray.kx]) - double(ray.origin[ray.kx]);
        const double along_y = double(corners[corner][ray.ky]) - double(ray.origin[ray.ky]);
        const double z = double(corners[corner][ray.kz]) - double(ray.origin[ray.kz]);
        x[corner] = along_x - ray.shear_xd * z;
        y[corner] = along_y - ray.shear_yd * z;
        edges.z[corner] = z;
        farthest = std::max({farthest, std::abs(along_x), std::abs(along_y), std::abs(z)});
        largest = std::max({largest, std::abs(x[corner]), std::abs(y[corner])});
    }
    edges.a = x[2] * y[1] - y[2] * x[1];
    edges.b = x[0] * y[2] - y[0] * x[2];
    edges.c = x[1] * y[0] - y[1] * x[0];

    // The error bound of the float filter (traverse.cpp), with 2^-53 for 2^-24 and this triangle's
    // farthest coordinate for the scene's.
    const double error = 0x1p-50 * farthest;
    edges.bound = (4.0 * error + 0x1p-50 * largest) * largest + 2.0 * error * error;
    edges.farthest = farthest;
    return edges;
}

/// Gives those edge functions whose sign is not certain their exact sign, and their value but for
/// the rounding of a sum and a quotient. False where signs differ: the values are then anything.
bool decide_edges(const PreparedRay& ray, const float (&corners)[3][3], EdgeFunctions& edges);

/// Where a line crosses the plane of a triangle, as meets_triangle() computes it in double.
struct PlaneCrossing {
    double t, u, v;  ///< t scaled
};

/// The crossing without rounding errors but for those of a quotient each, for a line that meets the
/// triangle; false where t, exactly, is not in the ray's interval.
bool exact_plane_crossing(const PreparedRay& ray, const float (&corners)[3][3],
                          PlaneCrossing& crossing);

/// The interval of the triangle's own box, in the arithmetic of the nodes' boxes; false where it is
/// empty. It is within the ray's [t_min, t_max].
[[gnu::always_inline]] inline bool own_interval(const PreparedRay& ray,
                                                const float (&corners)[3][3], float& near,
                                                float& far) {
    float planes[6];
    for (int axis = 0; axis < 3; ++axis) {
        const float p = corners[0][axis], q = corners[1][axis], r = corners[2][axis];
        planes[2 * axis] = std::min(p, std::min(q, r));
        planes[2 * axis + 1] = std::max(p, std::max(q, r));
    }
    box_interval(ray, planes, near, far);
    return near <= far;
}

/// Whether the ray meets the triangle at a distance that may be the least; then t (scaled), u and v
/// are the answer's. `corners` is [corner a, b, c][axis]; a triangle whose own box is entered
/// beyond `nearest` (scaled) may be called missed. Triangles without area are never met, nor is one
/// in whose plane the ray runs.
///
/// t is the mean of the corners' depths z, weighted by the edge functions. In double, an error e in
/// each of them moves it by no more than 3 e d / A, to first order, for the largest deviation d of
/// a z from t and the sum A of the weights; the roundings of mean and quotient by 2^-50 of the
/// largest |z|. `doubt` is A times that, with 4 for 3. Where it does not tell t to a unit in the
/// last place of float, or on which side of t_min or t_max, the crossing is computed without
/// rounding errors. As that is slow, the box is asked before.
[[gnu::always_inline]] inline bool meets_triangle(
    const PreparedRay& ray, const float (&corners)[3][3], float& t, float& u, float& v,
    float nearest = std::numeric_limits<float>::infinity()) {
    EdgeFunctions edges = edge_functions(ray, corners);
    if (edges.pass_by()) return false;
    float near, far;
    const bool asked_box = edges.is_vague();
    if (asked_box) {
        if (!own_interval(ray, corners, near, far) || near > nearest) return false;
        if (!decide_edges(ray, corners, edges)) return false;
    }
    const auto [a, b, c, z, error, farthest] = edges;
    const double area = a + b + c;
    if (area == 0.0) return false;
    const double depth = (a * z[0] + b * z[1] + c * z[2]) / area;
    PlaneCrossing crossing{depth * ray.shear_zd, b / area, c / area};

    const double size = std::abs(area);
    const double deviation =
        std::max({std::abs(z[0] - depth), std::abs(z[1] - depth), std::abs(z[2] - depth)});
    const double doubt =
        (4.0 * error * deviation + 0x1p-50 * farthest * size) * std::abs(ray.shear_zd);
    const double past_first = (crossing.t - ray.t_first) * size;
    const double before_last = (ray.t_last - crossing.t) * size;
    const bool vague = 0x1p26 * error > size;
    if (!vague && (past_first < -doubt || before_last < -doubt)) return false;
    if (!asked_box && (!own_interval(ray, corners, near, far) || near > nearest)) return false;
    if (vague || 0x1p24 * doubt > std::abs(crossing.t) * size || past_first <= doubt ||
        before_last <= doubt) {
        if (!exact_plane_crossing(ray, corners, crossing)) return false;
    }
    t = std::clamp(float(crossing.t), near, far);
    u = float(crossing.u);
    v = float(crossing.v);
    return true;
}

}  // namespace bvhlab
