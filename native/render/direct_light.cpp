// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/direct_light.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>
#include <stdexcept>

#include "base/parallel.h"
#include "render/compact.h"
#include "render/light_sampling.h"
#include "render/sampler.h"
#include "render/secondary.h"
#include "scene/color.h"
#include "trace/trace.h"

namespace bvhlab {
namespace {

constexpr std::size_t batch_rays = std::size_t(1) << 18;
constexpr std::size_t grain = 1024;

/// A primary hit that reflects light.
struct Surface {
    SurfacePoint point;
    glm::vec3 base_color;
    std::uint32_t ray;  ///< of the batch
};

/// A ray to a light and the radiance that it brings to its pixel where nothing is in between.
struct LightPath {
    Ray ray;
    glm::vec3 radiance;
};

/// One picture in the making. The members below `radiance_` are of the current batch.
class DirectLight {
public:
    DirectLight(const Bvh& bvh, const Scene& scene, const Camera& camera,
                const RenderOptions& options, Token& token)
        : bvh_(bvh),
          scene_(scene),
          camera_(camera),
          options_(options),
          token_(token),
          lights_(scene) {}

    Picture render();

private:
    void render_batch(std::size_t first_pixel, std::size_t pixels);
    void trace_primary();
    void see_surfaces();
    void add_light(std::size_t slot);
    void add_world();
    void average(std::size_t pixels);

    Hits trace_part(const RayBatch& rays, bool any_hit);
    void add_unoccluded(const Array<LightPath>& paths);
    LightPath light_path(const Surface& surface, std::size_t slot) const;

    /// Light paths that start from each hit.
    std::size_t slots() const { return std::min(lights_.size(), most_lights_at_a_hit); }
    Sampler sampler(std::size_t ray) const {
        return {std::uint32_t(first_pixel_ + ray / options_.samples),
                std::uint32_t(ray % options_.samples), options_.raster.seed};
    }

    const Bvh& bvh_;
    const Scene& scene_;
    const Camera& camera_;
    const RenderOptions& options_;
    Token& token_;
    const LightSampler lights_;
    Picture picture_;

    std::size_t first_pixel_ = 0;
    Array<glm::vec3> radiance_;  ///< by ray
    RayArrays primary_;
    Hits hits_;
    Array<Surface> surfaces_;
};

Hits DirectLight::trace_part(const RayBatch& rays, bool any_hit) {
    TraceOptions trace_options;
    trace_options.any_hit = any_hit;
    trace_options.threads = options_.threads;
    Token part(&token_);
    Hits hits = trace(bvh_, rays, trace_options, part);
    picture_.rays += rays.size();
    picture_.trace_seconds += hits.seconds();
    return hits;
}

void DirectLight::trace_primary() {
    const std::size_t count = radiance_.size();
    primary_ = {Array<glm::vec3>(count), Array<glm::vec3>(count)};
    parallel_for_each(count, grain, token_, [&](std::size_t i) {
        const CameraRay ray =
            camera_ray(camera_, options_.raster, std::uint32_t(first_pixel_ + i / options_.samples),
                       std::uint32_t(i % options_.samples));
        primary_.origins[i] = ray.origin;
        primary_.directions[i] = ray.direction;
    });
    const float t_min = 0.0F, t_max = std::numeric_limits<float>::infinity();
    hits_ = trace_part({primary_.origins, primary_.directions, {&t_min, 1}, {&t_max, 1}}, false);
}

/// Takes up what primary rays see directly, and finds the hits that reflect.
void DirectLight::see_surfaces() {
    parallel_for_each(radiance_.size(), grain, token_, [&](std::size_t i) {
        const std::uint32_t triangle = hits_.triangle[i];
        radiance_[i] = triangle == no_triangle ? scene_.world : scene_.material(triangle).emission;
    });

    const Array<std::uint32_t> kept = compact(radiance_.size(), token_, [&](std::size_t i) {
        return hits_.triangle[i] != no_triangle &&
               !is_black(scene_.material(hits_.triangle[i]).base_color);
    });
    const PrimaryHits hits{primary_.directions, hits_.u, hits_.v, hits_.triangle};
    surfaces_ = Array<Surface>(kept.size());
    parallel_for_each(kept.size(), grain, token_, [&](std::size_t i) {
        const std::uint32_t ray = kept[i];
        surfaces_[i] = {hits.surface(*scene_.mesh, ray),
                        scene_.material(hits_.triangle[ray]).base_color, ray};
    });
}

LightPath DirectLight::light_path(const Surface& surface, std::size_t slot) const {
    // Take the light of this slot, or draw one where there are more lights than slots.
    const Sampler random = sampler(surface.ray);
    const auto dimension = std::uint32_t(light_dimension + 2 * slot);
    std::size_t light = slot;
    double weight = 1.0;
    if (lights_.size() > slots()) {
        light = lights_.choose(random.pair(dimension).x, weight);
        weight = 1.0 / (weight * double(slots()));
    }

    // Reflect what arrives at the viewer's side.
    const LightSample sample =
        lights_.sample(light, surface.point.position, random.pair(dimension + 1));
    LightPath path{shadow_ray(surface.point, sample), glm::vec3(0.0F)};
    const double distance = glm::length(sample.to_light);
    const double cosine = glm::dot(surface.point.normal, sample.to_light) / distance;
    if (distance > 0.0 && cosine > 0.0 && path.ray.direction != glm::vec3(0.0F))
        path.radiance = glm::vec3(glm::dvec3(surface.base_color) * sample.irradiance *
                                  (cosine * weight / std::numbers::pi));
    return path;
}

void DirectLight::add_light(std::size_t slot) {
    Array<LightPath> paths(surfaces_.size());
    parallel_for_each(paths.size(), grain, token_,
                      [&](std::size_t i) { paths[i] = light_path(surfaces_[i], slot); });
    add_unoccluded(paths);
}

/// The cosine and the density of the direction cancel: each path brings base colour times world.
void DirectLight::add_world() {
    Array<LightPath> paths(surfaces_.size());
    parallel_for_each(paths.size(), grain, token_, [&](std::size_t i) {
        const Surface& surface = surfaces_[i];
        paths[i] = {diffuse_ray(surface.point, sampler(surface.ray).pair(diffuse_dimension)),
                    surface.base_color * scene_.world};
    });
    add_unoccluded(paths);
}

/// Traces the paths that bring anything, one of each surface, and adds those that get through.
void DirectLight::add_unoccluded(const Array<LightPath>& paths) {
    const Array<std::uint32_t> kept =
        compact(paths.size(), token_, [&](std::size_t i) { return !is_black(paths[i].radiance); });
    const std::size_t count = kept.size();
    RayArrays rays{Array<glm::vec3>(count), Array<glm::vec3>(count)};
    Array<float> t_max(count);
    parallel_for_each(count, grain, token_, [&](std::size_t i) {
        const Ray& ray = paths[kept[i]].ray;
        rays.origins[i] = ray.origin;
        rays.directions[i] = ray.direction;
        t_max[i] = ray.t_max;
    });

    const float t_min = 0.0F;
    const Hits hits = trace_part({rays.origins, rays.directions, {&t_min, 1}, t_max}, true);
    parallel_for_each(count, grain, token_, [&](std::size_t i) {
        if (!hits.occluded[i]) radiance_[surfaces_[kept[i]].ray] += paths[kept[i]].radiance;
    });
}

void DirectLight::average(std::size_t pixels) {
    const std::size_t samples = options_.samples;
    parallel_for_each(pixels, grain, token_, [&](std::size_t pixel) {
        glm::dvec3 sum(0.0);
        for (std::size_t i = 0; i < samples; ++i) sum += glm::dvec3(radiance_[pixel * samples + i]);
        picture_.pixels[first_pixel_ + pixel] = glm::vec3(sum / double(samples));
    });
}

void DirectLight::render_batch(std::size_t first_pixel, std::size_t pixels) {
    first_pixel_ = first_pixel;
    radiance_ = Array<glm::vec3>(pixels * options_.samples);
    trace_primary();
    see_surfaces();
    for (std::size_t slot = 0; slot < slots(); ++slot) add_light(slot);
    if (!is_black(scene_.world)) add_world();
    average(pixels);
}

Picture DirectLight::render() {
    const Stopwatch watch;
    token_.begin("rendering");
    const std::size_t pixels = std::size_t(options_.raster.width) * options_.raster.height;
    const std::size_t batch = std::max<std::size_t>(1, batch_rays / options_.samples);
    picture_.pixels = Array<glm::vec3>(pixels);
    for (std::size_t first = 0; first < pixels; first += batch) {
        render_batch(first, std::min(batch, pixels - first));
        token_.advance(float(std::min(first + batch, pixels)) / float(pixels));
    }
    picture_.seconds = watch.seconds();
    return std::move(picture_);
}

}  // namespace

Picture render(const Bvh& bvh, const Scene& scene, const Camera& camera,
               const RenderOptions& options, Token& token) {
    if (bvh.mesh != scene.mesh)
        throw std::invalid_argument("the tree and the scene are of different meshes");
    return with_threads(options.threads,
                        [&] { return DirectLight(bvh, scene, camera, options, token).render(); });
}

}  // namespace bvhlab
