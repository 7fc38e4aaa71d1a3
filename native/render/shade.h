// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/light_sampling.h"
#include "render/sampler.h"
#include "render/wave.h"
#include "scene/scene.h"

namespace bvhlab {

/// What happens to a path where its ray ends. Every function works on one path of a wave and
/// touches nothing of the others, as a kernel would. Scene and lights must outlive it.
///
/// Light is found in two ways: by light samples, and by directions drawn from the BSDF that happen
/// to meet it. Where both can find the same light, the power heuristic (Veach 1997, section 9.2.4)
/// weighs them, with as many light samples as there are shadow rays.
class Shader {
public:
    Shader(const Scene& scene, const LightSampler& lights, const PathSettings& settings,
           std::uint32_t seed);

    /// Whether directions drawn from a BSDF can find light, so that the last ones are traced too.
    bool bsdf_finds_light() const;

    /// Adds the light that the ray of path `i` meets: emission, world, lamps.
    void see(Wave& wave, std::size_t i) const;

    /// Decides whether the path passes straight through the surface that its ray met, as the
    /// `layer`-th since the last bounce. If so its ray is moved to the other side; else its
    /// throughput makes up for the paths that did. Call see() first.
    bool pass_through(Wave& wave, std::size_t i, std::uint32_t layer) const;

    /// Fetches what scatter() needs of the surfaces that the paths after `i` have met: they lie all
    /// over the memory, and waiting for them takes a fifth of the time otherwise.
    void prefetch(const Wave& wave, std::size_t i) const;

    /// Takes path `i` from its hit to its next ray: fills pass values and light paths on the way
    /// and turns the throughput black where the path ends.
    void scatter(Wave& wave, std::size_t i) const { (this->*scatter_)(wave, i); }

    /// What of the light along a light path passes the surface that it met: 0 unless it goes
    /// straight through, and then the path is moved to the other side. `hit` is index into `hits`.
    void pass_shadow(LightPaths& light, std::size_t i, const Hits& hits, std::size_t hit) const;

private:
    template <bool textured, bool gloss>
    struct Vertex;

    template <bool textured, bool gloss>
    void scatter_as(Wave& wave, std::size_t i) const;
    template <bool textured, bool gloss>
    void sample_light(Wave& wave, std::size_t i, const Vertex<textured, gloss>& vertex,
                      const LightOdds& odds, std::uint32_t index) const;
    template <bool textured, bool gloss>
    void sample_direction(Wave& wave, std::size_t i, const Vertex<textured, gloss>& vertex) const;

    LightOdds odds_before(const Paths& paths, std::size_t i) const;
    glm::vec3 seen_world(const Wave& wave, std::size_t i) const;
    glm::vec3 seen_emission(const Wave& wave, std::size_t i) const;
    glm::vec3 seen_lamps(const Wave& wave, std::size_t i) const;
    double pass_probability(const Wave& wave, std::size_t i, const glm::vec3& share) const;
    glm::vec2 uv(std::uint32_t triangle, float u, float v) const;
    float bsdf_weight(float pdf, double light_pdf) const;
    Sampler sampler(const Wave& wave, std::size_t i) const;

    const Scene& scene_;
    const LightSampler& lights_;
    PathSettings settings_;
    std::uint32_t seed_;
    void (Shader::*scatter_)(Wave&, std::size_t) const;  ///< for the features of the scene
};

}  // namespace bvhlab
