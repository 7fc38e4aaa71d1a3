// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/offset.h"
#include "scene/scene.h"

namespace bvhlab {

/// Texture coordinates at barycentrics u, v of a triangle. Requires that the scene has some.
inline glm::vec2 uv_at(const Scene& scene, std::uint32_t triangle, float u, float v) {
    const glm::vec2* corners = &scene.uvs[3 * std::size_t(triangle)];
    return (1.0F - u - v) * corners[0] + u * corners[1] + v * corners[2];
}

/// Unit normal between the corner normals, on the side of the surface's geometric normal, which it
/// is itself where the corner normals cancel. Corner normals are given for the side on which the
/// corners run counter-clockwise. Requires that the scene has some.
inline glm::vec3 shading_normal(const Scene& scene, std::uint32_t triangle, float u, float v,
                                const SurfacePoint& surface) {
    const glm::vec3* corners = &scene.normals[3 * std::size_t(triangle)];
    const glm::vec3 sum = (1.0F - u - v) * corners[0] + u * corners[1] + v * corners[2];
    const float squared = glm::dot(sum, sum);
    if (!(squared > 1e-12F)) return glm::vec3(surface.normal);
    return sum * ((surface.inside ? -1.0F : 1.0F) / std::sqrt(squared));
}

}  // namespace bvhlab
