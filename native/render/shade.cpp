// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/shade.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include "render/bsdf.h"
#include "render/interpolate.h"
#include "render/offset.h"
#include "render/shadow_ray.h"
#include "render/terminator.h"
#include "scene/color.h"

namespace bvhlab {

/// A hit that scatters light.
template <bool textured, bool gloss>
struct Shader::Vertex {
    SurfacePoint point;
    glm::vec3 normal;  ///< for shading
    Bsdf<textured, gloss> bsdf;
    Sampler random;
    std::uint32_t dimension;  ///< first of this bounce
    glm::dvec2 choice;        ///< of a lobe, of a light
};

namespace {

/// By how much shorter each surface that it passes straight through makes a light path.
constexpr float pass_reach = 0x1p-22F;

SurfacePoint hit_point(const Scene& scene, const Hits& hits, std::size_t i,
                       const glm::dvec3& direction) {
    return surface_point(scene.mesh->triangle(hits.triangle[i]), double(hits.u[i]),
                         double(hits.v[i]), direction);
}

}  // namespace

Shader::Shader(const Scene& scene, const LightSampler& lights, const PathSettings& settings,
               std::uint32_t seed)
    : scene_(scene), lights_(lights), settings_(settings), seed_(seed) {
    const Features& features = scene.features;
    scatter_ = features.textures ? features.gloss ? &Shader::scatter_as<true, true>
                                                  : &Shader::scatter_as<true, false>
               : features.gloss ? &Shader::scatter_as<false, true>
                                 : &Shader::scatter_as<false, false>;
}

bool Shader::bsdf_finds_light() const {
    const Features& features = scene_.features;
    return features.world || features.emitters || (features.gloss && features.lamps);
}

glm::vec2 Shader::uv(std::uint32_t triangle, float u, float v) const {
    return scene_.features.textures ? uv_at(scene_, triangle, u, v) : glm::vec2(0.0F);
}

Sampler Shader::sampler(const Wave& wave, std::size_t i) const {
    const std::uint32_t id = wave.paths.id[i];
    return {wave.range.pixel(id), wave.range.sample(id), seed_};
}

/// Weight of light found in a direction drawn with density `pdf`, which each light sample would
/// have found with density `light_pdf`.
float Shader::bsdf_weight(float pdf, double light_pdf) const {
    const double ratio = settings_.shadow_rays * light_pdf / double(pdf);
    return float(1.0 / (1.0 + ratio * ratio));
}

/// With which lights were drawn at the point that the ray of path `i` left.
LightOdds Shader::odds_before(const Paths& paths, std::size_t i) const {
    const glm::dvec3 behind = double(paths.travelled[i]) * glm::dvec3(paths.directions[i]);
    return lights_.odds(glm::dvec3(paths.origins[i]) - behind, glm::dvec3(paths.normals[i]));
}

/// Radiance of the world where the ray of path `i` meets nothing.
glm::vec3 Shader::seen_world(const Wave& wave, std::size_t i) const {
    const glm::dvec3 direction(wave.paths.directions[i]);
    const glm::vec3 radiance = lights_.world_radiance(direction);
    const float pdf = wave.paths.pdf[i];
    if (pdf == 0.0F) return radiance;
    const double light_pdf =
        lights_.world_pdf(odds_before(wave.paths, i), glm::dvec3(wave.paths.normals[i]), direction);
    return radiance * bsdf_weight(pdf, light_pdf);
}

/// Radiance that the surface emits which the ray of path `i` meets.
glm::vec3 Shader::seen_emission(const Wave& wave, std::size_t i) const {
    const Hits& hits = wave.hits;
    const std::uint32_t triangle = hits.triangle[i];
    const glm::vec3 radiance = emission(scene_, triangle, uv(triangle, hits.u[i], hits.v[i]));
    const float pdf = wave.paths.pdf[i];
    if (pdf == 0.0F || is_black(radiance)) return radiance;
    const glm::dvec3 direction(wave.paths.directions[i]);
    const SurfacePoint point = hit_point(scene_, hits, i, direction);
    const double distance = double(wave.paths.travelled[i]) + double(hits.t[i]);
    const double light_pdf = lights_.emitter_pdf(odds_before(wave.paths, i), triangle, distance,
                                                 glm::dot(point.normal, direction));
    return radiance * bsdf_weight(pdf, light_pdf);
}

/// Radiance of the lamps that the ray of path `i` passes on its way.
glm::vec3 Shader::seen_lamps(const Wave& wave, std::size_t i) const {
    const Paths& paths = wave.paths;
    const glm::dvec3 direction(paths.directions[i]);
    const double travelled = paths.travelled[i];
    const float pdf = paths.pdf[i];
    std::optional<LightOdds> odds;
    const auto find_odds = [&]() -> const LightOdds& {
        if (!odds) odds = odds_before(paths, i);
        return *odds;
    };
    glm::vec3 radiance(0.0F);
    lights_.for_lamps_met(glm::dvec3(paths.origins[i]) - travelled * direction, direction,
                          travelled, travelled + double(wave.hits.t[i]), find_odds,
                          [&](const LampHit& lamp) {
                              const float weight = pdf == 0.0F ? 1.0F : bsdf_weight(pdf, lamp.pdf);
                              radiance += glm::vec3(lamp.radiance) * weight;
                          });
    return radiance;
}

void Shader::see(Wave& wave, std::size_t i) const {
    glm::vec3 light(0.0F);
    if (wave.hits.triangle[i] == no_triangle) {
        if (scene_.features.world) light = seen_world(wave, i);
    } else if (scene_.features.emitters) {
        light = seen_emission(wave, i);
    }
    if (scene_.features.gloss && wave.bounce > 0 && lights_.lamps_can_be_met())
        light += seen_lamps(wave, i);
    wave.radiance[wave.paths.id[i]] += wave.paths.throughput[i] * light;
}

/// Probability of going straight on rather than scattering: in proportion to the light of each, so
/// that neither makes a path brighter.
double Shader::pass_probability(const Wave& wave, std::size_t i, const glm::vec3& share) const {
    const Hits& hits = wave.hits;
    const std::uint32_t triangle = hits.triangle[i];
    const glm::vec3 direction = wave.paths.directions[i];
    const SurfacePoint point = hit_point(scene_, hits, i, glm::dvec3(direction));
    const glm::vec3 normal(point.normal);
    const Bsdf<true, true> bsdf(scene_, scene_.material_index[triangle],
                                uv(triangle, hits.u[i], hits.v[i]), normal, normal, -direction,
                                point.inside);
    if (!bsdf.scatters()) return 1.0;
    const double through = luminance(share);
    const double scattered = std::max(luminance(bsdf.albedo()), 0.05 * through);
    return through / (through + scattered);
}

bool Shader::pass_through(Wave& wave, std::size_t i, std::uint32_t layer) const {
    const Hits& hits = wave.hits;
    Paths& paths = wave.paths;
    const std::uint32_t triangle = hits.triangle[i];
    if (triangle == no_triangle) return false;
    const glm::vec3 share = straight_through(scene_, triangle, uv(triangle, hits.u[i], hits.v[i]));
    if (is_black(share)) return false;

    const double probability = pass_probability(wave, i, share);
    const glm::dvec2 random = sampler(wave, i).pair(layer_dimension(wave.bounce, layer));
    if (random.x >= probability) {
        paths.throughput[i] /= float(1.0 - probability);
        return false;
    }
    const glm::dvec3 direction(paths.directions[i]);
    paths.throughput[i] *= share / float(probability);
    paths.origins[i] = offset_origin(hit_point(scene_, hits, i, direction), direction);
    paths.travelled[i] += hits.t[i];
    return true;
}

void Shader::pass_shadow(LightPaths& light, std::size_t i, const Hits& hits,
                         std::size_t hit) const {
    const std::uint32_t triangle = hits.triangle[hit];
    const glm::vec3 share =
        straight_through(scene_, triangle, uv(triangle, hits.u[hit], hits.v[hit]));
    light.radiance[i] *= share;
    if (is_black(share)) return;
    const glm::dvec3 direction(light.directions[i]);
    const glm::dvec3 end = glm::dvec3(light.origins[i]) + direction;
    light.origins[i] = offset_origin(hit_point(scene_, hits, hit, direction), direction);
    if (std::isinf(light.t_max[i])) return;
    // The new origin is not where the ray was: aim at the light's point again, and end a little
    // earlier for what rounding the direction moves that, so that the light does not hide itself.
    const glm::vec3 rest(end - glm::dvec3(light.origins[i]));
    const bool arrived = glm::dot(glm::dvec3(rest), direction) <= 0.0;
    if (!arrived) light.directions[i] = rest;
    light.t_max[i] = arrived ? 0.0F : light.t_max[i] - pass_reach;
}

template <bool textured, bool gloss>
void Shader::sample_light(Wave& wave, std::size_t i, const Vertex<textured, gloss>& vertex,
                          const LightOdds& odds, std::uint32_t index) const {
    const std::uint32_t count = settings_.shadow_rays;
    const LightSample sample = lights_.sample(
        odds, vertex.point.position, glm::dvec3(vertex.bsdf.normal()), index, count,
        vertex.choice.y, vertex.random.pair(vertex.dimension + first_shadow_pair + index));
    const double distance = glm::length(sample.to_light);
    if (!(distance > 0.0)) return;
    const BsdfValue bsdf = vertex.bsdf.evaluate(glm::vec3(sample.to_light / distance));
    if (is_black(bsdf.value)) return;
    const double density = count * sample.pdf;
    const double ratio = density > 0.0 ? double(bsdf.pdf) / density : 0.0;
    const glm::vec3 irradiance(sample.irradiance / (count * (1.0 + ratio * ratio)));
    const Hits& hits = wave.hits;
    const Ray ray = scene_.features.smooth
                        ? smooth_shadow_ray(scene_, hits.triangle[i], double(hits.u[i]),
                                            double(hits.v[i]), vertex.point, vertex.normal, sample)
                        : shadow_ray(vertex.point, sample);
    if (ray.direction == glm::vec3(0.0F)) return;
    const std::size_t place = i * count + index;
    wave.light.radiance[place] = wave.paths.throughput[i] * bsdf.value * irradiance;
    wave.light.origins[place] = ray.origin;
    wave.light.directions[place] = ray.direction;
    wave.light.t_max[place] = ray.t_max;
}

template <bool textured, bool gloss>
void Shader::sample_direction(Wave& wave, std::size_t i,
                              const Vertex<textured, gloss>& vertex) const {
    const BsdfSample sample = vertex.bsdf.sample(
        glm::vec2(vertex.random.pair(vertex.dimension + direction_pair)), float(vertex.choice.x));
    Paths& paths = wave.paths;
    paths.throughput[i] *= sample.weight;
    paths.origins[i] = offset_origin(vertex.point, glm::dvec3(sample.direction));
    paths.directions[i] = sample.direction;
    paths.normals[i] = vertex.bsdf.normal();
    paths.pdf[i] = sample.delta ? 0.0F : sample.pdf;
    paths.travelled[i] = 0.0F;
}

void Shader::prefetch(const Wave& wave, std::size_t i) const {
    constexpr std::size_t far = 16, near = 8;
    const Array<std::uint32_t>& met = wave.hits.triangle;
    if (i + far < met.size() && met[i + far] != no_triangle) {
        const std::uint32_t triangle = met[i + far];
        __builtin_prefetch(&scene_.mesh->triangles[triangle]);
        __builtin_prefetch(&scene_.material_index[triangle]);
        if (scene_.features.smooth) {
            __builtin_prefetch(&scene_.normals[3 * std::size_t(triangle)]);
            __builtin_prefetch(&scene_.normals[3 * std::size_t(triangle) + 2].z);
        }
    }
    if (i + near < met.size() && met[i + near] != no_triangle) {
        const glm::uvec3& corners = scene_.mesh->triangles[met[i + near]];
        for (int corner = 0; corner < 3; ++corner)
            __builtin_prefetch(&scene_.mesh->vertices[corners[corner]]);
    }
}

template <bool textured, bool gloss>
void Shader::scatter_as(Wave& wave, std::size_t i) const {
    const std::uint32_t triangle = wave.hits.triangle[i];
    const std::uint32_t count = settings_.shadow_rays;
    Paths& paths = wave.paths;
    std::fill_n(wave.light.radiance.begin() + std::ptrdiff_t(i * count), count, glm::vec3(0.0F));
    if (triangle == no_triangle) {
        paths.throughput[i] = glm::vec3(0.0F);
        return;
    }

    // Find the surface.
    const glm::vec3 direction = paths.directions[i];
    const float u = wave.hits.u[i], v = wave.hits.v[i];
    const SurfacePoint point = hit_point(scene_, wave.hits, i, glm::dvec3(direction));
    const glm::vec3 geometric(point.normal);
    const glm::vec3 normal =
        scene_.features.smooth ? shading_normal(scene_, triangle, u, v, point) : geometric;
    const Sampler random = sampler(wave, i);
    const std::uint32_t dimension = bounce_dimension(wave.bounce, count);
    const Vertex<textured, gloss> vertex{
        point,
        normal,
        {scene_, scene_.material_index[triangle],
         textured ? uv_at(scene_, triangle, u, v) : glm::vec2(0.0F), normal, geometric, -direction,
         point.inside},
        random,
        dimension,
        random.pair(dimension + choice_pair)};
    if (!wave.passes.empty() && wave.bounce == 0) {
        PassValues& pass = wave.passes[paths.id[i]];
        pass.normal = normal;
        pass.albedo = vertex.bsdf.albedo();
    }

    // Look for light, then go on.
    if (vertex.bsdf.scatters() && !vertex.bsdf.only_delta() && !lights_.empty() && count > 0) {
        const LightOdds odds = lights_.odds(point.position, glm::dvec3(vertex.bsdf.normal()));
        for (std::uint32_t index = 0; index < count && !odds.empty(); ++index)
            sample_light(wave, i, vertex, odds, index);
    }
    if (vertex.bsdf.scatters() && (wave.bounce < settings_.depth || bsdf_finds_light()))
        sample_direction(wave, i, vertex);
    else
        paths.throughput[i] = glm::vec3(0.0F);
}

}  // namespace bvhlab
