// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "base/array.h"
#include "base/token.h"
#include "render/camera_rays.h"
#include "render/light_sampling.h"
#include "render/offset.h"
#include "scene/scene.h"
#include "trace/ray.h"

namespace bvhlab {

/// What primary rays met, by ray: their directions, and the closest hits' barycentrics and
/// triangles.
struct PrimaryHits {
    std::span<const glm::vec3> directions;
    std::span<const float> u, v;
    std::span<const std::uint32_t> triangle;  ///< no_triangle where a ray missed

    std::size_t size() const { return triangle.size(); }
    SurfacePoint surface(const Mesh& mesh, std::size_t ray) const {
        return surface_point(mesh.triangle(triangle[ray]), double(u[ray]), double(v[ray]),
                             glm::dvec3(directions[ray]));
    }
};

/// Share of the way to a lamp at which shadow rays stop: geometry in the lamp's own plane, and the
/// emitting triangle itself, must not shadow it.
inline constexpr float shadow_reach = 1.0F - 0x1p-16F;

/// The ray from the surface to the light. Its direction is not normalised but runs to the sampled
/// point, which is at t = 1, and t_max is shadow_reach; towards a sun it has unit length and no
/// end. Where the sampled point is the surface point itself, the direction is zero.
Ray shadow_ray(const SurfacePoint& surface, const LightSample& light);

/// A ray in a cosine-distributed direction on the viewer's side, without end; the direction has
/// unit length.
Ray diffuse_ray(const SurfacePoint& surface, const glm::dvec2& random);

/// Shadow rays, for any-hit queries with t_min = 0.
struct ShadowRays {
    RayArrays rays;
    Array<float> t_max;
};

/// One shadow ray for each hit, in the order of the hits, none for a miss: towards a light chosen
/// by power, also where that light shines from behind; diffuse rays where the scene has no light.
/// For measurement: the same hits and seed give the same rays.
ShadowRays shadow_rays(const Scene& scene, const PrimaryHits& hits, std::uint32_t seed, int threads,
                       const Token& token);

/// One diffuse ray for each hit, in the order of the hits, none for a miss.
RayArrays diffuse_rays(const Scene& scene, const PrimaryHits& hits, std::uint32_t seed, int threads,
                       const Token& token);

}  // namespace bvhlab
