// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "base/array.h"
#include "render/distribution.h"
#include "scene/scene.h"

namespace bvhlab {

/// Texture coordinates at which an equirectangular picture is looked up for a unit direction; +Z is
/// up, and +X is seen in the picture's centre. In [0, 1], v = 0 at the nadir.
glm::dvec2 equirectangular_from_direction(const glm::dvec3& direction);

/// The unit direction that is seen at these coordinates.
glm::dvec3 direction_from_equirectangular(const glm::dvec2& uv);

/// A direction in which a background shines, with its radiance and density by solid angle.
struct EnvironmentSample {
    glm::dvec3 direction;
    glm::vec3 radiance;
    double pdf;
};

/// A background with a texture, for drawing directions with a density that follows its luminance.
///
/// Each texel draws points around its centre by the same tent with which bilinear look-up spreads
/// its colour (a box where it is not interpolated). So the density is the picture itself but for
/// the solid angle's change within a texel, and nothing lit is left out.
class Environment {
public:
    /// Requires a texture in the scene's world. The scene must outlive it.
    explicit Environment(const Scene& scene);

    /// Luminance averaged over the sphere.
    double mean_luminance() const { return mean_luminance_; }

    /// Linear RGB from the unit `direction`, in W/(m2 sr).
    glm::vec3 radiance(const glm::dvec3& direction) const;

    /// A unit direction for `random` in [0, 1)^2. Requires mean_luminance() > 0.
    EnvironmentSample sample(const glm::dvec2& random) const;

    /// Density with which `sample` draws the unit `direction`, by solid angle.
    double pdf(const glm::dvec3& direction) const;

private:
    friend struct LightParts;  ///< hands what was prepared to devices

    glm::vec3 radiance_at(const glm::dvec2& uv) const;
    double pdf_at(const glm::dvec2& uv) const;
    double interpolated_weight(const glm::dvec2& uv) const;
    double weight(std::int64_t column, std::int64_t row) const;

    const World* world_;
    const Texture* texture_;
    glm::dmat3 to_world_;
    std::size_t width_, height_;
    Array<float> weights_;  ///< luminance times solid angle, by texel, row by row from the top
    Array<double> sums_;    ///< block sums of each row of weights
    Distribution rows_;
    double total_weight_ = 0.0;
    double mean_luminance_ = 0.0;
};

}  // namespace bvhlab
