// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>

#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

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
/// The hit's distance is clamped to the computed interval of its triangle's *own box*, and a
/// triangle whose own box is missed is not hit. By monotony the ray then enters every box that
/// contains the triangle, at a distance not beyond the hit's: no tree can miss or cull it, and
/// which triangle is closest (ties: the lower index) is the same for all trees. Where a triangle
/// was split, its parts' boxes are padded so that the argument holds for one of them
/// (build/clip.h).
///
/// For boxes and distances, directions are scaled by a power of two so that the longest component
/// is in [1, 2); t is scaled with them. That keeps very long and very short directions away from
/// overflow. Components 2^-126 of the longest and less may lose bits or vanish there; the exact
/// decision is taken on the direction as given.
struct PreparedRay {
    glm::vec3 origin;
    glm::vec3 given_direction;
    glm::vec3 direction;  ///< scaled
    float t_min, t_max;   ///< scaled
    double unscale;       ///< the caller's t = scaled t * unscale
    int near_plane[3];    ///< row of WideNode::planes that the ray meets first, by axis
    int far_plane[3];
    glm::vec3 near_origin, far_origin;
    glm::vec3 near_inverse, far_inverse;
    int kx, ky, kz;          ///< kz: axis of the longest direction component
    float shear_x, shear_y;  ///< for the float filter
    float projection_error;  ///< bound on the float error of a projected coordinate
    double shear_xd, shear_yd, shear_zd;

    /// `bounds` is the mesh's box: the same for all trees.
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

inline PreparedRay::PreparedRay(const Ray& ray, const Box& bounds)
    : origin(ray.origin), given_direction(ray.direction) {
    constexpr float u = 0x1p-24F;

    // Scale by a power of two.
    const glm::vec3 size = glm::abs(ray.direction);
    const float longest = std::max(size.x, std::max(size.y, size.z));
    const int exponent = exponent_of(double(longest));
    const double scale = power_of_two(exponent);
    unscale = power_of_two(-exponent);
    for (int axis = 0; axis < 3; ++axis)
        direction[axis] = float(double(ray.direction[axis]) * unscale);
    t_min = float(double(ray.t_min) * scale);
    t_max = float(double(ray.t_max) * scale);

    // Nothing of the scene is farther than `reach` from the origin, along any axis.
    float reach = 0.0F;
    for (int axis = 0; axis < 3; ++axis)
        reach = std::max({reach, std::abs(bounds.lower[axis] - origin[axis]),
                          std::abs(bounds.upper[axis] - origin[axis])});

    // Slabs. A component too small to invert is taken as parallel: it moves the ray by less than
    // 2^-90 of the scene's size. The origin is then moved inward by `nudge` so that a ray in the
    // plane of a face counts as inside, without 0 * infinity.
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
    projection_error = 8.0F * u * reach;
}

/// The edge function of the edge between two corners without rounding errors, for the rare case
/// that double cannot tell its sign: det(d, from - origin, to - origin) / d[kz], d =
/// given_direction.
double exact_edge_function(const PreparedRay& ray, const float (&from)[3], const float (&to)[3]);

/// Computed interval [near, far] in which the ray is inside a box; `planes` by row of
/// WideNode::planes.
inline void box_interval(const PreparedRay& ray, const float (&planes)[6], float& near,
                         float& far) {
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
/// factor. Signs are exact, values are within some 2^-50 of the largest.
struct EdgeFunctions {
    double a, b, c;
    double z[3];  ///< depths of the corners
};

inline EdgeFunctions edge_functions(const PreparedRay& ray, const float (&corners)[3][3]) {
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
    const double bound = (4.0 * error + 0x1p-50 * largest) * largest + 2.0 * error * error;
    const auto decide = [&](double& value, int from, int to) {
        if (std::abs(value) <= bound) value = exact_edge_function(ray, corners[from], corners[to]);
    };
    decide(edges.a, 2, 1);
    decide(edges.b, 0, 2);
    decide(edges.c, 1, 0);
    return edges;
}

/// Whether the ray meets the triangle; then t (scaled), u and v are the answer's. `corners` is
/// [corner a, b, c][axis]. Triangles without area are never met, nor is one in whose plane the ray
/// runs.
inline bool meets_triangle(const PreparedRay& ray, const float (&corners)[3][3], float& t, float& u,
                           float& v) {
    const auto [a, b, c, z] = edge_functions(ray, corners);
    if ((a < 0.0 || b < 0.0 || c < 0.0) && (a > 0.0 || b > 0.0 || c > 0.0)) return false;
    const double area = a + b + c;
    if (area == 0.0) return false;
    t = float((a * z[0] + b * z[1] + c * z[2]) * ray.shear_zd / area);
    u = float(b / area);
    v = float(c / area);

    // The own box, in the arithmetic of the nodes' boxes.
    float planes[6];
    for (int axis = 0; axis < 3; ++axis) {
        const float p = corners[0][axis], q = corners[1][axis], r = corners[2][axis];
        planes[2 * axis] = std::min(p, std::min(q, r));
        planes[2 * axis + 1] = std::max(p, std::max(q, r));
    }
    float near, far;
    box_interval(ray, planes, near, far);
    if (!(near <= far)) return false;
    if (t < ray.t_min || t > ray.t_max) return false;
    t = std::clamp(t, near, far);
    return true;
}

}  // namespace bvhlab
