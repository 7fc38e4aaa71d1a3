// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "render/distribution.h"
#include "render/environment.h"
#include "render/lamp.h"
#include "scene/scene.h"

namespace bvhlab {

/// Draws points of the lights of a scene, and knows with which density: next event estimation with
/// multiple importance sampling.
///
/// There are two groups: near lights (lamps, emitting triangles) and distant ones (suns, the
/// world). Where both shine each gets half of the samples, for how bright they are at a point
/// cannot be compared beforehand. In a group lights are drawn by power; textured emission by its
/// mean. What is black is left out.
///
/// Lamps are no geometry. Only glossy surfaces are worth the search for lamps in directions drawn
/// from a BSDF: where the scene has none, lamp samples have pdf = 0.
class LightSampler {
public:
    /// The scene must outlive it.
    explicit LightSampler(const Scene& scene);

    /// Whether nothing shines, so that there is nothing to sample.
    bool empty() const { return !(near_share_ > 0.0 || distant_share_ > 0.0); }

    /// The sample `index` of `count` at a point, which together cover the lights evenly: with two
    /// samples each group gets one. Irradiance and pdf are those of one sample that knows nothing
    /// of the others: average the estimates over the count. `normal` (unit) is of the surface on
    /// the side from which a constant world is to be sampled; `choice` and `random` in [0, 1).
    /// Requires !empty().
    LightSample sample(const glm::dvec3& position, const glm::dvec3& normal, std::uint32_t index,
                       std::uint32_t count, double choice, const glm::dvec2& random) const;

    // The density by solid angle with which one sample finds what a ray has met:

    /// ... an emitting triangle at `distance`, whose normal has this cosine with the ray (of any
    /// sign). 0 where it does not emit.
    double emitter_pdf(std::uint32_t triangle, double distance, double cosine) const;

    /// ... the world, in the unit `direction` from a surface with this unit normal.
    double world_pdf(const glm::dvec3& normal, const glm::dvec3& direction) const;

    /// Linear RGB from the unit `direction`, W/(m2 sr).
    glm::vec3 world_radiance(const glm::dvec3& direction) const {
        return environment_ ? environment_->radiance(direction) : scene_->world.color;
    }

    /// Whether `for_lamps_met` can find anything.
    bool lamps_can_be_met() const { return !extended_.empty(); }

    /// Calls `add(const LampHit&)` for all lamps that the ray meets at distances in (t_min, t_max];
    /// suns are infinitely far. Lamps hide nothing, not each other either. `position` is where the
    /// direction was drawn, `direction` of unit length. In the order of the scene's lights.
    template <class Add>
    void for_lamps_met(const glm::dvec3& position, const glm::dvec3& direction, double t_min,
                       double t_max, const Add& add) const {
        LampHit hit;
        for (const ExtendedLamp& lamp : extended_) {
            if (!lamp.lamp.meet(position, direction, hit)) continue;
            if (!(hit.distance > t_min && hit.distance <= t_max)) continue;
            hit.pdf *= lamp.probability;
            add(hit);
        }
    }

private:
    struct ExtendedLamp {
        Lamp lamp;
        double probability;  ///< with which a sample chooses it
    };

    void add_near();
    void add_distant();
    LightSample sample_lamp(const Lamp& lamp, double probability, const glm::dvec3& position,
                            const glm::dvec2& random) const;
    LightSample sample_near(const glm::dvec3& position, double choice,
                            const glm::dvec2& random) const;
    LightSample sample_distant(const glm::dvec3& position, const glm::dvec3& normal, double choice,
                               const glm::dvec2& random) const;
    LightSample sample_emitter(const glm::dvec3& position, std::uint32_t triangle,
                               const glm::dvec2& random) const;
    LightSample sample_world(const glm::dvec3& normal, const glm::dvec2& random) const;

    const Scene* scene_;
    double near_share_ = 0.0, distant_share_ = 0.0;  ///< of the samples; 0, 0.5 or 1
    Distribution near_;                              ///< over lamps_, then emitters_
    Distribution distant_;                           ///< over suns_, then the world
    std::vector<Lamp> lamps_, suns_;                 ///< that shine
    std::vector<ExtendedLamp> extended_;             ///< of both, those that rays can meet
    Array<std::uint32_t> emitters_;                  ///< triangles
    std::vector<double> emitter_density_;            ///< of a sample's point, by area, by material
    std::optional<Environment> environment_;
    double world_probability_ = 0.0;  ///< with which a sample chooses the world
};

}  // namespace bvhlab
