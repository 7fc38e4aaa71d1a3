// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "scene/scene.h"

namespace bvhlab {

/// A random point of a light as seen from a position.
struct LightSample {
    glm::dvec3 to_light;  ///< from the position to the point; for a sun the unit direction to it
    bool distant;         ///< a sun: nothing is behind it
    glm::dvec3
        irradiance;  ///< unshadowed, on a surface that faces the point, in W/m2, divided by the
                     ///< probability of the sample; black where the light does not shine to
};

/// Draws a point of a lamp. The expected irradiance is that of Blender's physical units as Cycles
/// takes them from Blender 4.0 on: a point or spot of power P has the radiant intensity P / (4 pi),
/// of which a spot's cone masks a part; a sun of strength S gives the irradiance S; an area light
/// has the radiance P / (pi A).
LightSample sample_lamp(const Light& light, const glm::dvec3& position, const glm::dvec2& random);

/// The lights of a scene: its lamps, and all emitting triangles together as one more light.
class LightSampler {
public:
    explicit LightSampler(const Scene& scene);

    std::size_t size() const { return scene_->lights.size() + (emitters_.empty() ? 0 : 1); }

    /// Draws a light with a probability proportional to its power, for `random` in [0, 1).
    /// Requires size() > 0. `probability` receives the probability of the answer.
    std::size_t choose(double random, double& probability) const;

    /// Draws a point of light `index`.
    LightSample sample(std::size_t index, const glm::dvec3& position,
                       const glm::dvec2& random) const;

private:
    LightSample sample_emitters(const glm::dvec3& position, const glm::dvec2& random) const;

    const Scene* scene_;
    std::vector<std::uint32_t> emitters_;    ///< triangles of emitting materials
    std::vector<double> emitter_power_sum_;  ///< running sums over emitters_
    std::vector<double> light_power_sum_;    ///< running sums over lights
};

}  // namespace bvhlab
