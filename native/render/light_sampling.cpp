// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/light_sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/offset.h"
#include "render/sample_shapes.h"
#include "render/spherical_rectangle.h"
#include "scene/color.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

glm::dvec3 axis(const Light& light, int index) {
    return glm::dvec3(light.to_world[index]);
}
/// Unit vector against the direction in which the lamp shines.
glm::dvec3 shining_back(const Light& light) {
    return glm::normalize(axis(light, 2));
}
glm::dvec3 centre(const Light& light) {
    return glm::dvec3(light.to_world[3]);
}

/// Share of a spot's intensity in the unit direction `away` from it: smoothstep from the cone's
/// edge over the blended part of the cosine.
double spot_falloff(const Light& light, const glm::dvec3& away) {
    const double edge = std::cos(0.5 * light.spot_angle);
    const double inside = -glm::dot(away, shining_back(light)) - edge;
    if (!(inside > 0.0)) return 0.0;
    const double blended = (1.0 - edge) * light.spot_blend;
    if (inside >= blended) return 1.0;
    const double x = inside / blended;
    return x * x * (3.0 - 2.0 * x);
}

/// A disk that faces the position, of intensity P / (4 pi) along its axis. (Cycles' "soft falloff",
/// the default; it stays finite where the lamp touches a surface, and is a sphere's look from
/// afar.)
LightSample sample_point(const Light& light, const glm::dvec3& position, const glm::dvec2& random) {
    LightSample sample{centre(light) - position, false, glm::dvec3(0.0)};
    const double distance = glm::length(sample.to_light);
    if (distance == 0.0) return sample;
    const glm::dvec3 facing = sample.to_light / distance;
    if (light.size_x > 0.0)
        sample.to_light +=
            basis_about(facing) * glm::dvec3(light.size_x * sample_disk(random), 0.0);
    const double squared = glm::dot(sample.to_light, sample.to_light);
    sample.irradiance =
        glm::dvec3(light.color) * (distance / (4.0 * pi * squared * std::sqrt(squared)));
    return sample;
}

LightSample sample_spot(const Light& light, const glm::dvec3& position, const glm::dvec2& random) {
    LightSample sample = sample_point(light, position, random);
    const double distance = glm::length(sample.to_light);
    if (distance > 0.0) sample.irradiance *= spot_falloff(light, -sample.to_light / distance);
    return sample;
}

/// A disk at infinity; its radiance is such that a surface facing its centre has irradiance S.
LightSample sample_sun(const Light& light, const glm::dvec2& random) {
    const double half_sine = std::sin(0.25 * light.size_x);
    const double sagitta = 2.0 * half_sine * half_sine;
    const glm::dvec3 direction = sample_cone(shining_back(light), sagitta, random);
    return {direction, true, glm::dvec3(light.color) * (2.0 / (2.0 - sagitta))};
}

/// A rectangle by solid angle, where that is large enough to be computed and to matter.
LightSample sample_area(const Light& light, const glm::dvec3& position, const glm::dvec2& random) {
    const glm::dvec3 edge_x = light.size_x * axis(light, 0), edge_y = light.size_y * axis(light, 1);
    const glm::dvec3 to_centre = centre(light) - position;
    const glm::dvec3 back = shining_back(light);
    LightSample sample{to_centre, false, glm::dvec3(0.0)};
    if (!(glm::dot(to_centre, back) > 0.0)) return sample;
    const glm::dvec3 power(light.color);

    const double area = light.size_x * light.size_y;
    if (light.shape == LightShape::rectangle && area > 1e-4 * glm::dot(to_centre, to_centre)) {
        const SphericalRectangle seen(to_centre - 0.5 * (edge_x + edge_y), edge_x, edge_y);
        sample.to_light = seen.sample(random);
        sample.irradiance = power * (seen.solid_angle() / (pi * area));
        return sample;
    }
    const glm::dvec2 place =
        light.shape == LightShape::disk ? 0.5 * sample_disk(random) : random - 0.5;
    sample.to_light += place.x * edge_x + place.y * edge_y;
    const double squared = glm::dot(sample.to_light, sample.to_light);
    sample.irradiance =
        power * (glm::dot(sample.to_light, back) / (pi * squared * std::sqrt(squared)));
    return sample;
}

double area_of(const Triangle& triangle) {
    const glm::dvec3 a(triangle.a);
    return 0.5 * glm::length(glm::cross(glm::dvec3(triangle.b) - a, glm::dvec3(triangle.c) - a));
}

/// Power that a light sends towards the scene, for choosing lights only. A sun shines on the disk
/// around the scene's bounding sphere.
double lamp_power(const Light& light, const Box& bounds) {
    const double power = luminance(light.color);
    const glm::dvec3 diagonal = glm::dvec3(bounds.upper) - glm::dvec3(bounds.lower);
    switch (light.kind) {
        case LightKind::point:
            return power;
        case LightKind::spot:
            return power * 0.5 * (1.0 - std::cos(0.5 * light.spot_angle));
        case LightKind::area:
            return power;
        case LightKind::sun:
            return power * pi * 0.25 * glm::dot(diagonal, diagonal);
    }
    return 0.0;
}

void append_sum(std::vector<double>& sums, double value) {
    sums.push_back((sums.empty() ? 0.0 : sums.back()) + value);
}

/// Index drawn from running sums; where they are all 0, each index is as likely.
std::size_t choose_by_sum(const std::vector<double>& sums, double random, double& probability) {
    const std::size_t count = sums.size();
    if (sums.back() <= 0.0) {
        probability = 1.0 / double(count);
        return std::min(std::size_t(random * double(count)), count - 1);
    }
    const auto found = std::upper_bound(sums.begin(), sums.end(), random * sums.back());
    const std::size_t index = std::min(std::size_t(found - sums.begin()), count - 1);
    probability = (sums[index] - (index ? sums[index - 1] : 0.0)) / sums.back();
    return index;
}

}  // namespace

LightSample sample_lamp(const Light& light, const glm::dvec3& position, const glm::dvec2& random) {
    switch (light.kind) {
        case LightKind::point:
            return sample_point(light, position, random);
        case LightKind::spot:
            return sample_spot(light, position, random);
        case LightKind::sun:
            return sample_sun(light, random);
        case LightKind::area:
            return sample_area(light, position, random);
    }
    return {};
}

LightSampler::LightSampler(const Scene& scene) : scene_(&scene) {
    for (std::size_t i = 0; i < scene.mesh->size(); ++i) {
        const double radiance = luminance(scene.material(std::uint32_t(i)).emission);
        if (radiance <= 0.0) continue;
        const double area = area_of(scene.mesh->triangle(i));
        if (area <= 0.0) continue;
        emitters_.push_back(std::uint32_t(i));
        append_sum(emitter_power_sum_, 2.0 * pi * area * radiance);
    }
    for (const Light& light : scene.lights)
        append_sum(light_power_sum_, lamp_power(light, scene.mesh->bounds));
    if (!emitters_.empty()) append_sum(light_power_sum_, emitter_power_sum_.back());
}

std::size_t LightSampler::choose(double random, double& probability) const {
    return choose_by_sum(light_power_sum_, random, probability);
}

LightSample LightSampler::sample(std::size_t index, const glm::dvec3& position,
                                 const glm::dvec2& random) const {
    if (index < scene_->lights.size()) return sample_lamp(scene_->lights[index], position, random);
    return sample_emitters(position, random);
}

LightSample LightSampler::sample_emitters(const glm::dvec3& position,
                                          const glm::dvec2& random) const {
    // Choose a triangle by power and use what is left of the random number within its share.
    double probability;
    const std::size_t chosen = choose_by_sum(emitter_power_sum_, random.x, probability);
    const double below = chosen ? emitter_power_sum_[chosen - 1] / emitter_power_sum_.back() : 0.0;
    const double rest = std::clamp((random.x - below) / probability, 0.0, 1.0);

    // Choose a point uniformly by area, and keep clear of the triangle itself.
    const Triangle triangle = scene_->mesh->triangle(emitters_[chosen]);
    const double root = std::sqrt(rest);
    const glm::dvec3 away = glm::dvec3(triangle.a) - position;
    const SurfacePoint point =
        surface_point(triangle, root * (1.0 - random.y), root * random.y, away);
    LightSample sample{glm::dvec3(offset_origin(point, point.normal)) - position, false,
                       glm::dvec3(0.0)};

    const double squared = glm::dot(sample.to_light, sample.to_light);
    const double towards = -glm::dot(sample.to_light, point.normal);
    if (squared > 0.0 && towards > 0.0)
        sample.irradiance =
            glm::dvec3(scene_->material(emitters_[chosen]).emission) *
            (area_of(triangle) * towards / (squared * std::sqrt(squared) * probability));
    return sample;
}

}  // namespace bvhlab
