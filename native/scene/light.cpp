// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/light.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "scene/color.h"
#include "scene/transform.h"

namespace bvhlab {
namespace {

bool is_size(double value) {
    return std::isfinite(value) && value >= 0.0;
}

double area_of(const Light& light) {
    return glm::length(glm::cross(light.size_x * glm::dvec3(light.to_world[0]),
                                  light.size_y * glm::dvec3(light.to_world[1])));
}

}  // namespace

void check_light(const Light& light) {
    if (!is_affine(light.to_world))
        throw std::invalid_argument(
            "the light's to_world must be a finite (4, 4) matrix with last row 0, 0, 0, 1");
    if (light.kind != LightKind::point && !(glm::length(glm::dvec3(light.to_world[2])) > 0.0))
        throw std::invalid_argument(
            "the light's to_world leaves it no direction: its third column is zero");
    if (!is_radiance(light.color))
        throw std::invalid_argument("the light's color is " + color_text(light.color) +
                                    ": it must be finite and not negative");
    if (!is_size(light.size_x) || !is_size(light.size_y))
        throw std::invalid_argument("the light's size must be finite and not negative");
    if (light.kind == LightKind::area && !(area_of(light) > 0.0))
        throw std::invalid_argument(
            "the area light has no area, so it emits nothing: give it a width and a height above "
            "0, or leave it out");
    if (light.kind == LightKind::sun && light.size_x > std::numbers::pi)
        throw std::invalid_argument("the sun's angular diameter must be at most pi");
    if (!(light.spot_angle > 0.0) || !(light.spot_angle <= std::numbers::pi + 1e-6))
        throw std::invalid_argument("the light's spot_angle must be above 0 and at most pi");
    if (!(light.spot_blend >= 0.0) || !(light.spot_blend <= 1.0))
        throw std::invalid_argument("the light's spot_blend must be 0 to 1");
}

}  // namespace bvhlab
