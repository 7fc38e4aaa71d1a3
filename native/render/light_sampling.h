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
#include "render/light_odds.h"
#include "scene/scene.h"

namespace bvhlab {

/// Draws points of the lights of a scene, and knows with which density: next event estimation with
/// multiple importance sampling.
///
/// Lights are drawn by the power that arrives: the irradiance that each would bring to the point,
/// were nothing in between. Emitting triangles are one light there, within which they are drawn by
/// their power. Where there are more lamps than are worth a look at every point, lamps are drawn by
/// power alone, and near lights (lamps, emitting triangles) and distant ones (suns, the world),
/// whose powers cannot be compared, get half of the samples each. Textured emission counts by its
/// mean. What is black is left out.
///
/// Lamps are no geometry. Only glossy surfaces are worth the search for lamps in directions drawn
/// from a BSDF: where the scene has none, lamp samples have pdf = 0.
class LightSampler {
public:
    /// The scene must outlive it.
    explicit LightSampler(const Scene& scene);

    /// Whether nothing shines, so that there is nothing to sample.
    bool empty() const { return always_.empty(); }

    /// With which probabilities lights are drawn at a point; empty where none shines to it.
    /// `normal` (unit) is of the surface, on the viewer's side: where the scene transmits no light,
    /// what is behind the surface is left out.
    LightOdds odds(const glm::dvec3& position, const glm::dvec3& normal) const;

    /// The sample `index` of `count` at a point, which together cover the lights evenly. Irradiance
    /// and pdf are those of one sample that knows nothing of the others: average the estimates over
    /// the count. `odds` are those of position and normal, and not empty; a constant world is
    /// sampled on the side of the normal; `choice` and `random` in [0, 1).
    LightSample sample(const LightOdds& odds, const glm::dvec3& position, const glm::dvec3& normal,
                       std::uint32_t index, std::uint32_t count, double choice,
                       const glm::dvec2& random) const;

    // The density by solid angle with which one sample, by these odds, finds what a ray has met:

    /// ... an emitting triangle at `distance`, whose normal has this cosine with the ray (of any
    /// sign). 0 where it does not emit.
    double emitter_pdf(const LightOdds& odds, std::uint32_t triangle, double distance,
                       double cosine) const;

    /// ... the world, in the unit `direction` from a surface with this unit normal.
    double world_pdf(const LightOdds& odds, const glm::dvec3& normal,
                     const glm::dvec3& direction) const;

    /// Linear RGB from the unit `direction`, W/(m2 sr).
    glm::vec3 world_radiance(const glm::dvec3& direction) const {
        return environment_ ? environment_->radiance(direction) : scene_->world.color;
    }

    /// Whether `for_lamps_met` can find anything.
    bool lamps_can_be_met() const { return !extended_.empty(); }

    /// Calls `add(const LampHit&)` for all lamps that the ray meets at distances in (t_min, t_max];
    /// suns are infinitely far. Lamps hide nothing, not each other either. `position` is where the
    /// direction was drawn, with the odds that `find_odds()` gives; `direction` has unit length. In
    /// the order of the scene's lights.
    template <class FindOdds, class Add>
    void for_lamps_met(const glm::dvec3& position, const glm::dvec3& direction, double t_min,
                       double t_max, const FindOdds& find_odds, const Add& add) const {
        LampHit hit;
        for (const ExtendedLamp& lamp : extended_) {
            if (!lamp.lamp.meet(position, direction, hit, t_max)) continue;
            if (!(hit.distance > t_min && hit.distance <= t_max)) continue;
            hit.pdf *= lamp.share * find_odds().probability(lamp.entry);
            add(hit);
        }
    }

private:
    friend struct LightParts;  ///< hands what was prepared to devices

    /// Lamps or suns.
    struct Lamps {
        std::vector<Lamp> all;  ///< that shine
        Distribution by_power;
        double power = 0.0;  ///< luminance; W of lamps, W/m2 of suns
    };
    struct ExtendedLamp {
        Lamp lamp;
        std::size_t entry;  ///< of LightOdds
        double share;       ///< of that entry's samples
    };
    /// All emitting triangles, as if they were one light.
    struct Emitters {
        Array<std::uint32_t> triangles;
        Distribution by_power;
        std::vector<double> density;  ///< of a sample's point, by area, by material
        double power = 0.0;           ///< luminance, W
        glm::dvec3 centre{0.0};       ///< mean point, weighted by power
        double radius = 0.0;          ///< from it to the farthest
    };

    void add_lamps();
    void add_emitters();
    void add_world();
    void add_extended();
    void find_emitters_place(const std::vector<double>& powers);
    double emitters_brightness(const glm::dvec3& position, const glm::dvec3& normal) const;
    LightSample sample_lamp(const Lamp& lamp, double probability, const glm::dvec3& position,
                            const glm::dvec2& random) const;
    LightSample sample_one_of(const Lamps& lamps, double probability, double choice,
                              const glm::dvec3& position, const glm::dvec2& random) const;
    LightSample sample_emitter(const LightOdds& odds, const glm::dvec3& position,
                               std::uint32_t triangle, const glm::dvec2& random) const;
    LightSample sample_world(const LightOdds& odds, const glm::dvec3& normal,
                             const glm::dvec2& random) const;

    const Scene* scene_;
    Lamps lamps_, suns_;
    Emitters emitters_;
    std::optional<Environment> environment_;
    double world_brightness_ = 0.0;  ///< its weight, about the irradiance of all of it
    /// Whether odds differ from point to point. Their entries are then each lamp, the emitters,
    /// each sun and the world; else all lamps, the emitters, all suns and the world.
    bool compared_ = false;
    std::size_t emitters_entry_ = 0, world_entry_ = 0;
    LightOdds always_;                    ///< by power alone
    std::vector<ExtendedLamp> extended_;  ///< that rays can meet
};

}  // namespace bvhlab
