// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstdio>
#include <glm/vec3.hpp>
#include <string>

namespace bvhlab {

/// Luminance of linear Rec. 709 RGB.
inline double luminance(const glm::vec3& color) {
    return 0.2126 * double(color.r) + 0.7152 * double(color.g) + 0.0722 * double(color.b);
}

/// Whether every channel is finite and not negative.
inline bool is_radiance(const glm::vec3& color) {
    const auto usable = [](float channel) { return std::isfinite(channel) && channel >= 0.0F; };
    return usable(color.r) && usable(color.g) && usable(color.b);
}

inline bool is_black(const glm::vec3& color) {
    return color == glm::vec3(0.0F);
}

/// "(r, g, b)" for messages.
inline std::string color_text(const glm::vec3& color) {
    char text[64];
    std::snprintf(text, sizeof text, "(%g, %g, %g)", double(color.r), double(color.g),
                  double(color.b));
    return text;
}

}  // namespace bvhlab
