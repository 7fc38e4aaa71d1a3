// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/secondary.h"

#include <glm/geometric.hpp>
#include <limits>

#include "base/parallel.h"
#include "render/compact.h"
#include "render/sample_shapes.h"
#include "render/sampler.h"

namespace bvhlab {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr std::size_t grain = 1024;

/// Calls `make(surface, sampler)` for each hit and stores the rays it returns in the order of the
/// hits.
template <class MakeRay>
ShadowRays rays_from_hits(const Scene& scene, const PrimaryHits& hits, std::uint32_t seed,
                          int threads, const Token& token, const MakeRay& make) {
    return with_threads(threads, [&] {
        const Array<std::uint32_t> kept = compact(
            hits.size(), token, [&](std::size_t i) { return hits.triangle[i] != no_triangle; });
        const std::size_t count = kept.size();
        ShadowRays made{{Array<glm::vec3>(count), Array<glm::vec3>(count)}, Array<float>(count)};
        parallel_for_each(count, grain, token, [&](std::size_t i) {
            const Ray ray = make(hits.surface(*scene.mesh, kept[i]), Sampler(kept[i], 0, seed));
            made.rays.origins[i] = ray.origin;
            made.rays.directions[i] = ray.direction;
            made.t_max[i] = ray.t_max;
        });
        return made;
    });
}

}  // namespace

Ray shadow_ray(const SurfacePoint& surface, const LightSample& light) {
    const glm::vec3 origin = offset_origin(surface, light.to_light);
    if (light.distant) return {origin, 0.0F, glm::vec3(light.to_light), infinity};
    const glm::dvec3 end = surface.position + light.to_light;
    return {origin, 0.0F, glm::vec3(end - glm::dvec3(origin)), shadow_reach};
}

Ray diffuse_ray(const SurfacePoint& surface, const glm::dvec2& random) {
    const glm::dvec3 direction = sample_cosine(surface.normal, random);
    return {offset_origin(surface, direction), 0.0F, glm::vec3(direction), infinity};
}

ShadowRays shadow_rays(const Scene& scene, const PrimaryHits& hits, std::uint32_t seed, int threads,
                       const Token& token) {
    const LightSampler lights(scene);
    const auto make = [&](const SurfacePoint& surface, const Sampler& sampler) {
        if (lights.size() > 0) {
            double probability;
            const std::size_t chosen = lights.choose(sampler.pair(light_dimension).x, probability);
            const Ray ray = shadow_ray(surface, lights.sample(chosen, surface.position,
                                                              sampler.pair(light_dimension + 1)));
            if (ray.direction != glm::vec3(0.0F)) return ray;
        }
        return diffuse_ray(surface, sampler.pair(diffuse_dimension));
    };
    return rays_from_hits(scene, hits, seed, threads, token, make);
}

RayArrays diffuse_rays(const Scene& scene, const PrimaryHits& hits, std::uint32_t seed, int threads,
                       const Token& token) {
    const auto make = [](const SurfacePoint& surface, const Sampler& sampler) {
        return diffuse_ray(surface, sampler.pair(diffuse_dimension));
    };
    return rays_from_hits(scene, hits, seed, threads, token, make).rays;
}

}  // namespace bvhlab
