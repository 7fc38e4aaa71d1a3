// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "render/offset.h"
#include "render/shadow_ray.h"
#include "scene/scene.h"

namespace bvhlab {

/// Cosine between a triangle and the directions to lights up to which shadow rays are lifted off
/// it: Blender's default.
inline constexpr double terminator_cosine = 0.1;

/// How far a shadow ray's origin is lifted off a smooth triangle, so that the edge of its own
/// shadow follows the smooth shape and not the triangles: Hanika 2021, "Hacking the Shadow
/// Terminator". The point moves to where the planes through the corners, at right angles to the
/// corner normals, lie above it. `side` (unit) is the triangle's normal on the side of the light;
/// `facing` its cosine to the light. The lift fades out towards lights that the triangle itself
/// faces, whose shadows it would displace. Requires that the scene has corner normals.
inline glm::dvec3 terminator_lift(const Scene& scene, std::uint32_t triangle, double u, double v,
                                  const glm::dvec3& position, bool inside, double facing,
                                  const glm::dvec3& side) {
    const double amount = std::clamp(1.0 - facing / terminator_cosine, 0.0, 1.0);
    if (amount == 0.0) return glm::dvec3(0.0);
    const Triangle corners = scene.mesh->triangle(triangle);
    const glm::vec3* normals = &scene.normals[3 * std::size_t(triangle)];
    const glm::vec3 places[] = {corners.a, corners.b, corners.c};
    const double weights[] = {1.0 - u - v, u, v};
    glm::dvec3 lift(0.0);
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 normal(inside ? -normals[i] : normals[i]);
        const double height = glm::dot(position - glm::dvec3(places[i]), normal);
        lift -= weights[i] * std::min(0.0, height) * normal;
    }
    // Odd corner normals must not push it through the triangle.
    return glm::dot(lift, side) > 0.0 ? amount * lift : glm::dvec3(0.0);
}

/// The shadow ray (see shadow_ray) from a smooth triangle, whose light may come from below the
/// triangle itself; it starts on the side on which the shading normal has the light.
inline Ray smooth_shadow_ray(const Scene& scene, std::uint32_t triangle, double u, double v,
                             const SurfacePoint& surface, const glm::vec3& shading_normal,
                             const LightSample& light) {
    const bool reflects = glm::dot(glm::dvec3(shading_normal), light.to_light) >= 0.0;
    const glm::dvec3 side = reflects ? surface.normal : -surface.normal;
    const double facing = glm::dot(side, light.to_light) / glm::length(light.to_light);
    SurfacePoint start = surface;
    start.position += terminator_lift(scene, triangle, u, v, surface.position,
                                      surface.inside == reflects, facing, side);
    return ray_to_light(offset_origin(start, side), surface, light);
}

}  // namespace bvhlab
