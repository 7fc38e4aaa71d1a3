// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "scene/color.h"
#include "scene/scene.h"

namespace bvhlab {

/// offset + scale * texel, of a linear RGBA texel; not clamped.
inline glm::vec3 scaled(const Lookup& lookup, const glm::vec4& texel) {
    glm::vec3 value(texel);
    switch (lookup.channel) {
        case Channel::rgb:
            break;
        case Channel::red:
            value = glm::vec3(texel.r);
            break;
        case Channel::green:
            value = glm::vec3(texel.g);
            break;
        case Channel::blue:
            value = glm::vec3(texel.b);
            break;
        case Channel::alpha:
            value = glm::vec3(texel.a);
            break;
        case Channel::luminance:
            value = glm::vec3(float(luminance(glm::vec3(texel))));
            break;
    }
    return lookup.offset + lookup.scale * value;
}

/// The value at the texture coordinates `uv` of a surface, not clamped.
inline glm::vec3 looked_up(const Scene& scene, std::uint32_t index, const glm::vec2& uv) {
    const Lookup& lookup = scene.lookups[index];
    return scaled(lookup,
                  look_up(*scene.textures[lookup.texture], lookup.mapping * glm::vec3(uv, 1.0F)));
}

/// `value` in [0, most]; 0 for NaN.
inline float clamped(float value, float most) {
    return value > 0.0F ? std::min(value, most) : 0.0F;
}
inline glm::vec3 clamped(const glm::vec3& value, float most) {
    return {clamped(value.r, most), clamped(value.g, most), clamped(value.b, most)};
}

/// The value of a number in [0, 1]; without textures none is looked up.
template <bool textured>
float value_of(const Scene& scene, const NumberInput& input, const glm::vec2& uv) {
    if (!textured || input.lookup == no_lookup) return input.value;
    return clamped(looked_up(scene, input.lookup, uv).x, 1.0F);
}

/// The value of a colour, each channel in [0, most].
template <bool textured>
glm::vec3 value_of(const Scene& scene, const ColorInput& input, const glm::vec2& uv,
                   float most = 1.0F) {
    if (!textured || input.lookup == no_lookup) return input.value;
    return clamped(looked_up(scene, input.lookup, uv), most);
}

}  // namespace bvhlab
