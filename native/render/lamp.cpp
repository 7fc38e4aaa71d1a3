// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/lamp.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "render/offset.h"
#include "render/sample_shapes.h"
#include "render/spherical_rectangle.h"
#include "scene/color.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

constexpr double smallest_angle = 0x1p-23;
/// Sine of the least angle at which geometry through the middle of a disk lamp may be crossed
/// without hiding it.
constexpr double disk_sine = 0.25;
/// A rectangle is drawn by solid angle where that is above about this many steradians: large enough
/// to be computed and to matter.
constexpr double smallest_solid_angle = 1e-4;

glm::dvec3 axis(const Light& light, int index) {
    return glm::dvec3(light.to_world[index]);
}

/// 1 - cosine of the angular radius, without cancellation.
double sagitta(double angular_diameter) {
    const double half_sine = std::sin(0.25 * angular_diameter);
    return 2.0 * half_sine * half_sine;
}

}  // namespace

Lamp::Lamp(const Light& light)
    : kind_(light.kind),
      ellipse_(light.shape == LightShape::disk),
      right_angled_(true),
      centre_(light.to_world[3]),
      back_(0.0, 0.0, 1.0),
      edge_x_(light.size_x * axis(light, 0)),
      edge_y_(light.size_y * axis(light, 1)),
      strength_(light.color),
      extent_(light.size_x),
      luminance_(luminance(light.color)),
      spot_edge_(std::cos(0.5 * light.spot_angle)),
      spot_blended_((1.0 - spot_edge_) * light.spot_blend) {
    if (kind_ != LightKind::point) back_ = glm::normalize(axis(light, 2));
    if (kind_ == LightKind::point || kind_ == LightKind::spot) {
        strength_ /= 4.0 * pi;
        luminance_ /= 4.0 * pi;
    }
    reach_ = glm::length(centre_) + glm::length(edge_x_) + glm::length(edge_y_);
    if (kind_ == LightKind::sun)
        extent_ = light.size_x > smallest_angle ? sagitta(light.size_x) : 0.0;
    if (kind_ != LightKind::area) return;

    size_ = {glm::length(edge_x_), glm::length(edge_y_)};
    if (size_.x > 0.0) unit_x_ = edge_x_ / size_.x;
    if (size_.y > 0.0) unit_y_ = edge_y_ / size_.y;

    // Sheared lamps shine along the normal of their parallelogram.
    const glm::dvec3 cross = glm::cross(edge_x_, edge_y_);
    const double area = glm::length(cross);
    back_ = cross / (glm::dot(cross, back_) < 0.0 ? -area : area);
    right_angled_ = std::abs(glm::dot(edge_x_, edge_y_)) <= 1e-6 * area;
    extent_ = ellipse_ ? 0.25 * pi * area : area;
    strength_ /= pi * extent_;
    luminance_ /= pi * extent_;
}

/// Distance at which a ray counts as meeting the lamp, whose plane it crosses at `distance` and at
/// an angle of this sine: off the plane (end_clearance), so that geometry in it does not hide it.
double Lamp::nearer(double distance, double sine) const {
    return std::max(0.0, distance - end_clearance * (reach_ + distance) / sine);
}

LightSample Lamp::sample(const glm::dvec3& position, const glm::dvec2& random) const {
    if (kind_ == LightKind::sun) return sample_sun(random);
    const bool area = kind_ == LightKind::area;
    LightSample sample = area ? sample_area(position, random) : sample_disk_lamp(position, random);
    const double distance = glm::length(sample.to_light);
    if (!(distance > 0.0)) return sample;
    // Disks face the position, so that what lies in their plane is crossed aslant, if at all.
    const double sine = area ? glm::dot(sample.to_light, back_) / distance : disk_sine;
    sample.to_light *= sine > 0.0 ? nearer(distance, sine) / distance : 0.0;
    return sample;
}

bool Lamp::meet(const glm::dvec3& position, const glm::dvec3& direction, LampHit& hit,
                double t_max) const {
    switch (kind_) {
        case LightKind::point:
        case LightKind::spot:
            return meet_disk_lamp(position, direction, hit, t_max);
        case LightKind::sun:
            return meet_sun(direction, hit, t_max);
        case LightKind::area:
            return meet_area(position, direction, hit, t_max);
    }
    return false;
}

/// Share of a spot's intensity in the unit direction `away` from it: smoothstep from the cone's
/// edge over the blended part of the cosine.
double Lamp::spot_mask(const glm::dvec3& away) const {
    const double inside = -glm::dot(away, back_) - spot_edge_;
    if (!(inside > 0.0)) return 0.0;
    if (inside >= spot_blended_) return 1.0;
    const double x = inside / spot_blended_;
    return x * x * (3.0 - 2.0 * x);
}

LightSample Lamp::sample_disk_lamp(const glm::dvec3& position, const glm::dvec2& random) const {
    LightSample sample{.to_light = centre_ - position};
    const double distance = glm::length(sample.to_light);
    if (distance == 0.0) return sample;
    const glm::dvec3 facing = sample.to_light / distance;
    const bool seen_as_disk = extent_ > smallest_angle * distance;
    if (seen_as_disk)
        sample.to_light += basis_about(facing) * glm::dvec3(extent_ * sample_disk(random), 0.0);
    const double squared = glm::dot(sample.to_light, sample.to_light);
    const double reach = std::sqrt(squared), cubed = squared * reach;
    // As in Cycles, the cone's edge is soft: the direction is that to the point on the disk.
    const double mask = kind_ == LightKind::spot ? spot_mask(-sample.to_light / reach) : 1.0;
    if (mask == 0.0) return sample;
    sample.irradiance = strength_ * (mask * distance / cubed);
    if (seen_as_disk) sample.pdf = cubed / (distance * pi * extent_ * extent_);
    return sample;
}

bool Lamp::meet_disk_lamp(const glm::dvec3& position, const glm::dvec3& direction, LampHit& hit,
                          double t_max) const {
    const glm::dvec3 to_centre = centre_ - position;
    const double squared = glm::dot(to_centre, to_centre);
    const double along = glm::dot(to_centre, direction);
    if (!(along > 0.0)) return false;
    hit.distance = nearer(squared / along, disk_sine);
    if (hit.distance > t_max) return false;
    // The disk's plane is squared / along away; there, the ray passes the centre at distance
    // |to_centre| tan(angle), and cross = |to_centre| sin(angle).
    const glm::dvec3 cross = glm::cross(to_centre, direction);
    if (glm::dot(cross, cross) * squared > extent_ * extent_ * along * along) return false;
    const double distance = std::sqrt(squared);
    if (!(extent_ > smallest_angle * distance)) return false;
    const double mask = kind_ == LightKind::spot ? spot_mask(-direction) : 1.0;
    if (mask == 0.0) return false;
    hit.radiance = strength_ * (mask / (pi * extent_ * extent_));
    const double reach = squared / along;
    hit.pdf = reach * reach * distance / (along * pi * extent_ * extent_);
    return true;
}

/// Its radiance is such that a surface facing its centre has irradiance S.
LightSample Lamp::sample_sun(const glm::dvec2& random) const {
    return {sample_cone(back_, extent_, random), true, strength_ * (2.0 / (2.0 - extent_)),
            extent_ > 0.0 ? 0.5 / (pi * extent_) : 0.0};
}

bool Lamp::meet_sun(const glm::dvec3& direction, LampHit& hit, double t_max) const {
    if (t_max < std::numeric_limits<double>::infinity()) return false;
    const glm::dvec3 chord = direction - back_;
    if (glm::dot(chord, chord) > 2.0 * extent_) return false;
    hit = {strength_ / (pi * extent_ * (2.0 - extent_)), std::numeric_limits<double>::infinity(),
           0.5 / (pi * extent_)};
    return true;
}

bool Lamp::is_drawn_by_solid_angle(double squared_distance) const {
    return !ellipse_ && right_angled_ && extent_ > smallest_solid_angle * squared_distance;
}

/// A rectangle by solid angle where that matters, else by area.
LightSample Lamp::sample_area(const glm::dvec3& position, const glm::dvec2& random) const {
    LightSample sample{.to_light = centre_ - position};
    const double height = glm::dot(sample.to_light, back_);
    const double squared_distance = glm::dot(sample.to_light, sample.to_light);
    if (!(height > 0.0)) return sample;

    if (is_drawn_by_solid_angle(squared_distance)) {
        const SphericalRectangle seen(sample.to_light - 0.5 * (edge_x_ + edge_y_), unit_x_, unit_y_,
                                      size_);
        if (!(seen.solid_angle() > 0.0)) return sample;
        sample.to_light = seen.sample(random);
        sample.irradiance = strength_ * seen.solid_angle();
        sample.pdf = 1.0 / seen.solid_angle();
        return sample;
    }
    const glm::dvec2 place = ellipse_ ? 0.5 * sample_disk(random) : random - 0.5;
    sample.to_light += place.x * edge_x_ + place.y * edge_y_;
    const double squared = glm::dot(sample.to_light, sample.to_light);
    const double solid_angle = extent_ * height / (squared * std::sqrt(squared));
    sample.irradiance = strength_ * solid_angle;
    if (extent_ > smallest_angle * smallest_angle * squared_distance)
        sample.pdf = 1.0 / solid_angle;
    return sample;
}

bool Lamp::meet_area(const glm::dvec3& position, const glm::dvec3& direction, LampHit& hit,
                     double t_max) const {
    const double slope = glm::dot(direction, back_);
    if (!(slope > 0.0)) return false;
    const glm::dvec3 to_centre = centre_ - position;
    const double height = glm::dot(to_centre, back_);
    if (!(height > 0.0)) return false;
    const double distance = height / slope;
    hit.distance = nearer(distance, slope);
    if (hit.distance > t_max) return false;
    const glm::dvec3 place = direction * distance - to_centre;

    // Coordinates along the edges, -0.5 to 0.5; cross products, as edges may be sheared.
    const glm::dvec3 normal = glm::cross(edge_x_, edge_y_);
    const double squared_area = glm::dot(normal, normal);
    const double x = glm::dot(glm::cross(place, edge_y_), normal) / squared_area;
    const double y = glm::dot(glm::cross(edge_x_, place), normal) / squared_area;
    if (ellipse_ ? x * x + y * y > 0.25 : std::max(std::abs(x), std::abs(y)) > 0.5) return false;

    const double squared_distance = glm::dot(to_centre, to_centre);
    hit.radiance = strength_;
    if (is_drawn_by_solid_angle(squared_distance)) {
        const SphericalRectangle seen(to_centre - 0.5 * (edge_x_ + edge_y_), unit_x_, unit_y_,
                                      size_);
        if (!(seen.solid_angle() > 0.0)) return false;
        hit.pdf = 1.0 / seen.solid_angle();
        return true;
    }
    if (!(extent_ > smallest_angle * smallest_angle * squared_distance)) return false;
    hit.pdf = distance * distance / (extent_ * slope);
    return true;
}

// --- brightness ----------------------------------------------------------------------------------

double Lamp::brightness(const glm::dvec3& position, const glm::dvec3& normal) const {
    if (kind_ == LightKind::area) return brightness_of_area(centre_ - position, normal);
    if (kind_ != LightKind::sun) return brightness_of_disk(centre_ - position, normal);
    if (normal == glm::dvec3(0.0)) return luminance_;
    // The sine of its radius is at most sqrt(2 extent).
    return luminance_ * std::clamp(glm::dot(normal, back_) + std::sqrt(2.0 * extent_), 0.0, 1.0);
}

double Lamp::brightness_of_disk(const glm::dvec3& to_centre, const glm::dvec3& normal) const {
    const double squared = glm::dot(to_centre, to_centre);
    if (!(squared > 0.0)) return 0.0;
    const double distance = std::sqrt(squared);
    double facing = 1.0;
    if (kind_ == LightKind::spot && extent_ == 0.0) facing = spot_mask(-to_centre / distance);
    if (normal != glm::dvec3(0.0))
        facing *= std::clamp((glm::dot(normal, to_centre) + extent_) / distance, 0.0, 1.0);
    return luminance_ * facing / (squared + extent_ * extent_);
}

/// As if all of it were at its nearest point, but for what a disk of this area on the axis brings
/// at most.
double Lamp::brightness_of_area(const glm::dvec3& to_centre, const glm::dvec3& normal) const {
    const double height = glm::dot(to_centre, back_);
    if (!(height > 0.0)) return 0.0;
    double facing = 1.0;
    if (normal != glm::dvec3(0.0)) {
        const double half =
            0.5 * (std::abs(glm::dot(normal, edge_x_)) + std::abs(glm::dot(normal, edge_y_)));
        const double highest = glm::dot(normal, to_centre) + half;
        if (!(highest > 0.0)) return 0.0;
        facing = std::min(1.0, highest / glm::length(to_centre));
    }
    const double x = std::max(0.0, std::abs(glm::dot(to_centre, unit_x_)) - 0.5 * size_.x);
    const double y = std::max(0.0, std::abs(glm::dot(to_centre, unit_y_)) - 0.5 * size_.y);
    const double squared = height * height + x * x + y * y;
    return luminance_ * extent_ * facing * height / (std::sqrt(squared) * (squared + extent_ / pi));
}

}  // namespace bvhlab
