// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/light_sampling.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

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
    add_lamps();
    add_emitters();
    add_world();

    // Odds by power alone.
    compared_ = lamps_.all.size() + suns_.all.size() + 2 <= LightOdds::most;
    emitters_entry_ = compared_ ? lamps_.all.size() : 1;
    world_entry_ = compared_ ? emitters_entry_ + 1 + suns_.all.size() : 3;
    const double near = lamps_.power + emitters_.power;
    const double distant = suns_.power + world_brightness_;
    const double near_share = near > 0.0 ? (distant > 0.0 ? 0.5 : 1.0) / near : 0.0;
    const double distant_share = distant > 0.0 ? (near > 0.0 ? 0.5 : 1.0) / distant : 0.0;
    always_.add(near_share * lamps_.power);
    always_.add(near_share * emitters_.power);
    always_.add(distant_share * suns_.power);
    always_.add(distant_share * world_brightness_);

    if (scene.features.gloss) add_extended();
}

void LightSampler::add_lamps() {
    std::vector<double> powers, irradiances;
    for (const Light& light : scene_->lights) {
        if (is_black(light.color)) continue;
        const bool sun = light.kind == LightKind::sun;
        (sun ? suns_ : lamps_).all.emplace_back(light);
        if (sun)
            irradiances.push_back(luminance(light.color));
        else
            powers.push_back(power_of(light));
    }
    lamps_.by_power = distribution_of(powers, largest_of(powers));
    lamps_.power = std::reduce(powers.begin(), powers.end());
    suns_.by_power = distribution_of(irradiances, largest_of(irradiances));
    suns_.power = std::reduce(irradiances.begin(), irradiances.end());
}

/// A point on an emitting triangle is drawn with a density that follows its radiance alone.
void LightSampler::add_emitters() {
    std::vector<double>& density = emitters_.density;
    for (const Material& material : scene_->materials)
        density.push_back(2.0 * pi * mean_emission(*scene_, material));
    if (!scene_->features.emitters) return;
    const Mesh& mesh = *scene_->mesh;
    const auto power_of_triangle = [&](std::size_t i) {
        return density[scene_->material_index[i]] * area_of(mesh.triangle(i));
    };
    emitters_.triangles =
        compact(mesh.size(), Token(), [&](std::size_t i) { return power_of_triangle(i) > 0.0; });
    std::vector<double> powers;
    for (const std::uint32_t triangle : emitters_.triangles)
        powers.push_back(power_of_triangle(triangle));
    find_emitters_place(powers);

    const double largest = largest_of(powers);
    emitters_.by_power = distribution_of(powers, largest);
    for (double& value : density)
        value = value > 0.0 ? value / (largest * emitters_.by_power.total()) : 0.0;
}

/// How much power, and the ball it comes from.
void LightSampler::find_emitters_place(const std::vector<double>& powers) {
    const Mesh& mesh = *scene_->mesh;
    emitters_.power = std::reduce(powers.begin(), powers.end());
    for (std::size_t i = 0; i < powers.size(); ++i) {
        const Triangle triangle = mesh.triangle(emitters_.triangles[i]);
        const glm::dvec3 middle =
            (glm::dvec3(triangle.a) + glm::dvec3(triangle.b) + glm::dvec3(triangle.c)) / 3.0;
        emitters_.centre += middle * (powers[i] / emitters_.power);
    }
    for (const std::uint32_t index : emitters_.triangles) {
        const Triangle triangle = mesh.triangle(index);
        for (const glm::vec3& corner : {triangle.a, triangle.b, triangle.c})
            emitters_.radius =
                std::max(emitters_.radius, glm::distance(glm::dvec3(corner), emitters_.centre));
    }
}

/// A constant world counts half: directions drawn from the BSDF find it as well as light samples,
/// and mostly it is hidden (on the atrium, that is 5% less variance than in full).
void LightSampler::add_world() {
    world_brightness_ = 0.5 * pi * luminance(scene_->world.color);
    if (!scene_->features.environment) return;
    environment_.emplace(*scene_);
    world_brightness_ = pi * environment_->mean_luminance();
}

void LightSampler::add_extended() {
    const auto add = [&](const Lamps& lamps, std::size_t first_entry, std::size_t entry) {
        for (std::size_t i = 0; i < lamps.all.size(); ++i) {
            if (!lamps.all[i].has_extent()) continue;
            if (compared_)
                extended_.push_back({lamps.all[i], first_entry + i, 1.0});
            else
                extended_.push_back({lamps.all[i], entry, lamps.by_power.probability(i)});
        }
    };
    add(lamps_, 0, 0);
    add(suns_, emitters_entry_ + 1, 2);
}

// --- odds ----------------------------------------------------------------------------------------

LightOdds LightSampler::odds(const glm::dvec3& position, const glm::dvec3& normal) const {
    if (!compared_) return always_;
    const glm::dvec3 facing = scene_->features.transmission ? glm::dvec3(0.0) : normal;
    LightOdds odds;
    for (const Lamp& lamp : lamps_.all) odds.add(lamp.brightness(position, facing));
    odds.add(emitters_brightness(position, facing));
    for (const Lamp& sun : suns_.all) odds.add(sun.brightness(position, facing));
    odds.add(world_brightness_);
    return odds;
}

/// As Lamp::brightness(): of a ball that shines in all directions.
double LightSampler::emitters_brightness(const glm::dvec3& position,
                                         const glm::dvec3& normal) const {
    if (emitters_.triangles.empty()) return 0.0;
    const glm::dvec3 to_centre = emitters_.centre - position;
    const double squared = glm::dot(to_centre, to_centre), radius = emitters_.radius;
    const double highest = glm::dot(normal, to_centre) + radius;
    if (normal != glm::dvec3(0.0) && !(highest > 0.0)) return 0.0;
    return emitters_.power / (4.0 * pi * (squared + radius * radius));
}

// --- samples -------------------------------------------------------------------------------------

LightSample LightSampler::sample(const LightOdds& odds, const glm::dvec3& position,
                                 const glm::dvec3& normal, std::uint32_t index, std::uint32_t count,
                                 double choice, const glm::dvec2& random) const {
    const auto [entry, rest] = odds.choose((double(index) + choice) / double(count));
    if (entry == world_entry_) return sample_world(odds, normal, random);
    if (entry == emitters_entry_) {
        const std::size_t chosen = emitters_.by_power.choose(rest).index;
        return sample_emitter(odds, position, emitters_.triangles[chosen], random);
    }
    const double probability = odds.probability(entry);
    const bool sun = entry > emitters_entry_;
    const Lamps& lamps = sun ? suns_ : lamps_;
    if (!compared_) return sample_one_of(lamps, probability, rest, position, random);
    return sample_lamp(lamps.all[sun ? entry - emitters_entry_ - 1 : entry], probability, position,
                       random);
}

LightSample LightSampler::sample_one_of(const Lamps& lamps, double probability, double choice,
                                        const glm::dvec3& position,
                                        const glm::dvec2& random) const {
    const std::size_t chosen = lamps.by_power.choose(choice).index;
    return sample_lamp(lamps.all[chosen], probability * lamps.by_power.probability(chosen),
                       position, random);
}

LightSample LightSampler::sample_lamp(const Lamp& lamp, double probability,
                                      const glm::dvec3& position, const glm::dvec2& random) const {
    LightSample sample = lamp.sample(position, random);
    sample.irradiance /= probability;
    sample.pdf *= lamps_can_be_met() ? probability : 0.0;
    return sample;
}

/// A point uniformly by area, a little off the triangle, so that it is not in its own shadow.
LightSample LightSampler::sample_emitter(const LightOdds& odds, const glm::dvec3& position,
                                         std::uint32_t triangle, const glm::dvec2& random) const {
    const double root = std::sqrt(random.x);
    const double u = root * (1.0 - random.y), v = root * random.y;
    const Triangle corners = scene_->mesh->triangle(triangle);
    const SurfacePoint point = surface_point(corners, u, v, glm::dvec3(corners.a) - position);
    LightSample sample{.to_light = point.position - position};
    const double size = glm::length(point.position) + glm::length(sample.to_light);
    sample.to_light += end_clearance * size * point.normal;

    const double distance = glm::length(sample.to_light);
    const double towards = -glm::dot(sample.to_light, point.normal);
    if (!(distance > 0.0 && towards > 0.0)) return sample;
    sample.pdf = emitter_pdf(odds, triangle, distance, towards / distance);
    const glm::vec2 uv =
        scene_->features.textures ? uv_at(*scene_, triangle, float(u), float(v)) : glm::vec2(0.0F);
    sample.irradiance = glm::dvec3(emission(*scene_, triangle, uv)) / sample.pdf;
    return sample;
}

double LightSampler::emitter_pdf(const LightOdds& odds, std::uint32_t triangle, double distance,
                                 double cosine) const {
    const double density = emitters_.density[scene_->material_index[triangle]];
    if (!(density > 0.0)) return 0.0;
    return odds.probability(emitters_entry_) * density * distance * distance / std::abs(cosine);
}

/// By the texture, or in proportion to the cosine where all directions are as bright.
LightSample LightSampler::sample_world(const LightOdds& odds, const glm::dvec3& normal,
                                       const glm::dvec2& random) const {
    if (environment_) {
        const EnvironmentSample drawn = environment_->sample(random);
        if (!(drawn.pdf > 0.0)) return {drawn.direction, true};
        const double pdf = odds.probability(world_entry_) * drawn.pdf;
        return {drawn.direction, true, glm::dvec3(drawn.radiance) / pdf, pdf};
    }
    const glm::dvec3 direction = sample_cosine(normal, random);
    const double pdf = world_pdf(odds, normal, direction);
    if (!(pdf > 0.0)) return {direction, true};
    return {direction, true, glm::dvec3(scene_->world.color) / pdf, pdf};
}

double LightSampler::world_pdf(const LightOdds& odds, const glm::dvec3& normal,
                               const glm::dvec3& direction) const {
    const double probability = odds.probability(world_entry_);
    if (environment_) return probability * environment_->pdf(direction);
    return probability * std::max(0.0, glm::dot(normal, direction)) / pi;
}

}  // namespace bvhlab
