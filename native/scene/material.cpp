// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/material.h"

#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <string>

#include "scene/color.h"

namespace bvhlab {
namespace {

std::string number_text(float value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", double(value));
    return text;
}

void check_range(const char* name, float value, float least, float most) {
    if (value >= least && value <= most) return;  // false for NaN
    throw std::invalid_argument(std::string(name) + " is " + number_text(value) + ": it must be " +
                                number_text(least) + " to " + number_text(most));
}

bool is_finite(const glm::vec3& value) {
    return std::isfinite(value.x) && std::isfinite(value.y) && std::isfinite(value.z);
}

}  // namespace

void check_lookup(const Lookup& lookup) {
    if (!is_finite(lookup.scale) || !is_finite(lookup.offset))
        throw std::invalid_argument("scale " + color_text(lookup.scale) + " and offset " +
                                    color_text(lookup.offset) + " must be finite");
    for (int column = 0; column < 3; ++column)
        if (!std::isfinite(lookup.mapping[column].x) || !std::isfinite(lookup.mapping[column].y))
            throw std::invalid_argument("the mapping must be finite");
}

void check_component(const Component& component) {
    check_range("weight", component.weight.value, 0.0F, 1.0F);
    check_range("roughness", component.roughness.value, 0.0F, 1.0F);
    check_range("metallic", component.metallic.value, 0.0F, 1.0F);
    check_range("transmission", component.transmission.value, 0.0F, 1.0F);
    check_range("ior", component.ior, 1.0F, 10.0F);
    check_range("specular", component.specular, 0.0F, most_specular);
    const glm::vec3& color = component.color.value;
    for (const float channel : {color.r, color.g, color.b})
        if (!(channel >= 0.0F && channel <= 1.0F))
            throw std::invalid_argument("color is " + color_text(color) +
                                        ": each channel must be 0 to 1");
}

void check_emission(const glm::vec3& emission) {
    if (!is_radiance(emission))
        throw std::invalid_argument("emission is " + color_text(emission) +
                                    ": it must be finite and not negative");
}

bool is_lambertian(const Component& component) {
    if (component.model == Model::diffuse) return true;
    const auto is_zero = [](const NumberInput& input) {
        return input.lookup == no_lookup && input.value == 0.0F;
    };
    return component.model == Model::principled && is_zero(component.metallic) &&
           is_zero(component.transmission) && (component.specular == 0.0F || component.ior == 1.0F);
}

}  // namespace bvhlab
