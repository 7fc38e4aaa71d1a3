// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>

#include "render/light_sampling.h"
#include "render/offset.h"
#include "trace/ray.h"

namespace bvhlab {

/// Share of the way at which shadow rays to a point end: before it. Points of lamps and emitting
/// triangles keep off these (end_clearance), so that what is met there is met at t >= 1.
inline constexpr float shadow_reach = 1.0F - 0x1p-24F;

/// The ray from `origin`, near the surface, to the light that was sampled from it, for t_min = 0.
/// Its direction is not normalised but runs to the sampled point, which is at t = 1, and t_max is
/// shadow_reach; towards a sun or the world it has unit length and no end. Where the sampled point
/// is the origin, the direction is zero.
inline Ray ray_to_light(const glm::vec3& origin, const SurfacePoint& surface,
                        const LightSample& light) {
    if (light.distant)
        return {origin, 0.0F, glm::vec3(light.to_light), std::numeric_limits<float>::infinity()};
    const glm::dvec3 end = surface.position + light.to_light;
    return {origin, 0.0F, glm::vec3(end - glm::dvec3(origin)), shadow_reach};
}

inline Ray shadow_ray(const SurfacePoint& surface, const LightSample& light) {
    return ray_to_light(offset_origin(surface, light.to_light), surface, light);
}

}  // namespace bvhlab
