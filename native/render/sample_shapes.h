// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <numbers>

namespace bvhlab {

/// A right-handed basis whose third axis is the unit vector z (Duff et al. 2017, "Building an
/// Orthonormal Basis, Revisited").
inline glm::dmat3 basis_about(const glm::dvec3& z) {
    const double sign = std::copysign(1.0, z.z);
    const double a = -1.0 / (sign + z.z);
    const double b = z.x * z.y * a;
    return {
        {1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x}, {b, sign + z.y * z.y * a, -z.y}, z};
}

/// Point of the unit disk, uniform by area; keeps strata compact (Shirley & Chiu 1997).
inline glm::dvec2 sample_disk(const glm::dvec2& random) {
    const glm::dvec2 square = 2.0 * random - 1.0;
    if (square.x == 0.0 && square.y == 0.0) return {0.0, 0.0};
    const bool wide = std::abs(square.x) > std::abs(square.y);
    const double radius = wide ? square.x : square.y;
    const double angle =
        wide ? std::numbers::pi / 4.0 * (square.y / square.x)
             : std::numbers::pi / 2.0 - std::numbers::pi / 4.0 * (square.x / square.y);
    return radius * glm::dvec2(std::cos(angle), std::sin(angle));
}

/// Unit direction about `normal` with density cos / pi.
inline glm::dvec3 sample_cosine(const glm::dvec3& normal, const glm::dvec2& random) {
    const glm::dvec2 disk = sample_disk(random);
    const double height = std::sqrt(std::max(0.0, 1.0 - glm::dot(disk, disk)));
    return basis_about(normal) * glm::dvec3(disk, height);
}

/// Unit direction within a cone about `axis`, uniform by solid angle; the cone's cosine is 1 -
/// `sagitta`.
inline glm::dvec3 sample_cone(const glm::dvec3& axis, double sagitta, const glm::dvec2& random) {
    const double drop = random.x * sagitta;
    const double sine = std::sqrt(std::max(0.0, drop * (2.0 - drop)));
    const double angle = 2.0 * std::numbers::pi * random.y;
    return basis_about(axis) *
           glm::dvec3(sine * std::cos(angle), sine * std::sin(angle), 1.0 - drop);
}

}  // namespace bvhlab
