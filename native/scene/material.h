// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <glm/vec3.hpp>

namespace bvhlab {

/// A Lambertian surface that may emit; both sides are alike.
struct Material {
    glm::vec3 base_color{0.8F};  ///< reflectance, linear RGB in [0, 1]
    glm::vec3 emission{0.0F};    ///< radiance, linear RGB in W/(m2 sr)
};

}  // namespace bvhlab
