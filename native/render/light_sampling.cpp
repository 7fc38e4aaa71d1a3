// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/light_sampling.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "base/parallel.h"
#include "render/bsdf.h"
#include "render/compact.h"
#include "render/interpolate.h"
#include "render/material_input.h"
#include "render/offset.h"
#include "render/sample_shapes.h"
#include "scene/color.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

double area_of(const Triangle& triangle) {
    const glm::dvec3 a(triangle.a);
    return 0.5 * glm::length(glm::cross(glm::dvec3(triangle.b) - a, glm::dvec3(triangle.c) - a));
}

/// Power in W of a lamp other than a sun.
double power_of(const Light& light) {
    const double cone =
        light.kind == LightKind::spot ? 0.5 * (1.0 - std::cos(0.5 * light.spot_angle)) : 1.0;
    return cone * luminance(light.color);
}

double largest_of(const std::vector<double>& powers) {
    return powers.empty() ? 0.0 : *std::max_element(powers.begin(), powers.end());
}

/// Probabilities in proportion to powers. They are divided by the largest, so that float holds
/// those of a scene of any size.
Distribution distribution_of(const std::vector<double>& powers, double largest) {
    Array<float> weights(powers.size());
    for (std::size_t i = 0; i < powers.size(); ++i)
        weights[i] = largest > 0.0 ? float(powers[i] / largest) : 0.0F;
    return Distribution(std::move(weights));
}

/// Luminance of a material's emission, where it is looked up of the texture's mean.
double mean_emission(const Scene& scene, const Material& material) {
    const ColorInput& emission = material.emission;
    if (emission.lookup == no_lookup) return luminance(emission.value);
    const Lookup& lookup = scene.lookups[emission.lookup];
    const glm::vec3 mean = scaled(lookup, average(*scene.textures[lookup.texture]));
    return luminance(glm::max(mean, 0.0F));
}

}  // namespace

LightSampler::LightSampler(const Scene& scene) : scene_(&scene) {
    add_near();
    add_distant();

    // Divide the samples between the groups.
    const bool near = near_.total() > 0.0, distant = distant_.total() > 0.0;
    near_share_ = near ? (distant ? 0.5 : 1.0) : 0.0;
    distant_share_ = distant ? 1.0 - near_share_ : 0.0;
    for (double& density : emitter_density_) density *= near_share_;
    world_probability_ *= distant_share_;

    if (!scene.features.gloss) return;
    for (std::size_t i = 0; i < lamps_.size(); ++i)
        if (lamps_[i].has_extent())
            extended_.push_back({lamps_[i], near_share_ * near_.probability(i)});
    for (std::size_t i = 0; i < suns_.size(); ++i)
        if (suns_[i].has_extent())
            extended_.push_back({suns_[i], distant_share_ * distant_.probability(i)});
}

void LightSampler::add_near() {
    std::vector<double> powers;
    for (const Light& light : scene_->lights) {
        if (light.kind == LightKind::sun || is_black(light.color)) continue;
        lamps_.emplace_back(light);
        powers.push_back(power_of(light));
    }

    // A point on an emitting triangle is drawn with a density that follows its radiance alone.
    for (const Material& material : scene_->materials)
        emitter_density_.push_back(2.0 * pi * mean_emission(*scene_, material));
    const Mesh& mesh = *scene_->mesh;
    const auto power_of_triangle = [&](std::size_t i) {
        return emitter_density_[scene_->material_index[i]] * area_of(mesh.triangle(i));
    };
    if (scene_->features.emitters)
        emitters_ = compact(mesh.size(), Token(),
                            [&](std::size_t i) { return power_of_triangle(i) > 0.0; });
    for (const std::uint32_t triangle : emitters_) powers.push_back(power_of_triangle(triangle));

    const double largest = largest_of(powers);
    near_ = distribution_of(powers, largest);
    for (double& density : emitter_density_)
        density = density > 0.0 ? density / (largest * near_.total()) : 0.0;
}

/// Suns by their irradiance, and the world by the mean of what it could bring.
void LightSampler::add_distant() {
    std::vector<double> powers;
    for (const Light& light : scene_->lights) {
        if (light.kind != LightKind::sun || is_black(light.color)) continue;
        suns_.emplace_back(light);
        powers.push_back(luminance(light.color));
    }
    double world = luminance(scene_->world.color);
    if (scene_->features.environment) {
        environment_.emplace(*scene_);
        world = environment_->mean_luminance();
    }
    powers.push_back(pi * world);

    distant_ = distribution_of(powers, largest_of(powers));
    if (distant_.total() > 0.0) world_probability_ = distant_.probability(suns_.size());
}

LightSample LightSampler::sample(const glm::dvec3& position, const glm::dvec3& normal,
                                 std::uint32_t index, std::uint32_t count, double choice,
                                 const glm::dvec2& random) const {
    const double place = (double(index) + choice) / double(count);
    if (place < near_share_) return sample_near(position, place / near_share_, random);
    return sample_distant(position, normal, (place - near_share_) / distant_share_, random);
}

LightSample LightSampler::sample_near(const glm::dvec3& position, double choice,
                                      const glm::dvec2& random) const {
    const std::size_t chosen = near_.choose(choice).index;
    if (chosen >= lamps_.size())
        return sample_emitter(position, emitters_[chosen - lamps_.size()], random);
    return sample_lamp(lamps_[chosen], near_share_ * near_.probability(chosen), position, random);
}

LightSample LightSampler::sample_distant(const glm::dvec3& position, const glm::dvec3& normal,
                                         double choice, const glm::dvec2& random) const {
    const std::size_t chosen = distant_.choose(choice).index;
    if (chosen == suns_.size()) return sample_world(normal, random);
    return sample_lamp(suns_[chosen], distant_share_ * distant_.probability(chosen), position,
                       random);
}

LightSample LightSampler::sample_lamp(const Lamp& lamp, double probability,
                                      const glm::dvec3& position, const glm::dvec2& random) const {
    LightSample sample = lamp.sample(position, random);
    sample.irradiance /= probability;
    sample.pdf *= lamps_can_be_met() ? probability : 0.0;
    return sample;
}

/// A point uniformly by area, a little off the triangle, so that it is not in its own shadow.
LightSample LightSampler::sample_emitter(const glm::dvec3& position, std::uint32_t triangle,
                                         const glm::dvec2& random) const {
    const double root = std::sqrt(random.x);
    const double u = root * (1.0 - random.y), v = root * random.y;
    const Triangle corners = scene_->mesh->triangle(triangle);
    const SurfacePoint point = surface_point(corners, u, v, glm::dvec3(corners.a) - position);
    LightSample sample{.to_light = glm::dvec3(offset_origin(point, point.normal)) - position};

    const double distance = glm::length(sample.to_light);
    const double towards = -glm::dot(sample.to_light, point.normal);
    if (!(distance > 0.0 && towards > 0.0)) return sample;
    sample.pdf = emitter_pdf(triangle, distance, towards / distance);
    const glm::vec2 uv =
        scene_->features.textures ? uv_at(*scene_, triangle, float(u), float(v)) : glm::vec2(0.0F);
    sample.irradiance = glm::dvec3(emission(*scene_, triangle, uv)) / sample.pdf;
    return sample;
}

double LightSampler::emitter_pdf(std::uint32_t triangle, double distance, double cosine) const {
    const double density = emitter_density_[scene_->material_index[triangle]];
    return density > 0.0 ? density * distance * distance / std::abs(cosine) : 0.0;
}

/// By the texture, or in proportion to the cosine where all directions are as bright.
LightSample LightSampler::sample_world(const glm::dvec3& normal, const glm::dvec2& random) const {
    if (environment_) {
        const EnvironmentSample drawn = environment_->sample(random);
        if (!(drawn.pdf > 0.0)) return {drawn.direction, true};
        const double pdf = world_probability_ * drawn.pdf;
        return {drawn.direction, true, glm::dvec3(drawn.radiance) / pdf, pdf};
    }
    const glm::dvec3 direction = sample_cosine(normal, random);
    const double pdf = world_pdf(normal, direction);
    if (!(pdf > 0.0)) return {direction, true};
    return {direction, true, glm::dvec3(scene_->world.color) / pdf, pdf};
}

double LightSampler::world_pdf(const glm::dvec3& normal, const glm::dvec3& direction) const {
    if (environment_) return world_probability_ * environment_->pdf(direction);
    return world_probability_ * std::max(0.0, glm::dot(normal, direction)) / pi;
}

}  // namespace bvhlab
