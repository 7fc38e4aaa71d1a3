// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/microfacet.h"
#include "scene/scene.h"

namespace bvhlab {

/// A direction drawn from a BSDF.
struct BsdfSample {
    glm::vec3 direction;  ///< unit length, away from the surface
    glm::vec3 weight;     ///< bsdf * |cosine| / pdf; black: the path ends
    float pdf;            ///< by solid angle, of all lobes together; 0 where `delta`
    bool delta;           ///< a mirror or smooth glass, which no other strategy can find
    bool through;         ///< to the other side of the surface
};

/// bsdf * |cosine| for two directions, and the density with which `sample` draws the second.
struct BsdfValue {
    glm::vec3 value;
    float pdf;
};

/// Radiance that the triangle's material emits: finite, not negative.
glm::vec3 emission(const Scene& scene, std::uint32_t triangle, const glm::vec2& uv);

/// Share of light that passes the triangle's `transparent` components unscattered, RGB in [0, 1].
/// A Bsdf holds the rest: it is not normalised for it.
glm::vec3 straight_through(const Scene& scene, std::uint32_t triangle, const glm::vec2& uv);

/// What a material's Lambertian reflections reflect together, in [0, 1].
template <bool textured>
glm::vec3 lambertian_color(const Scene& scene, const Material& material, const glm::vec2& uv);

/// How a material scatters light at a point, but for its `transparent` components. A scene without
/// textures takes no coordinates, and one without gloss (Features) is Lambertian.
///
/// A direction on the wrong side of the triangle itself, as there may be where the shading normal
/// is tilted, is never drawn. Light from there is reflected all the same: the tracer decides
/// whether it arrives (render/terminator.h). It does not go through. Radiance is carried without
/// the factor of the squared index of refraction, as usual: it cancels where light leaves glass
/// again.
template <bool textured, bool gloss>
class Bsdf;

/// Lambertian reflection.
template <bool textured>
class Bsdf<textured, false> {
public:
    /// As Bsdf<textured, true>; to_viewer and inside do not matter.
    Bsdf(const Scene& scene, std::uint32_t material, const glm::vec2& uv,
         const glm::vec3& shading_normal, const glm::vec3& geometric_normal,
         const glm::vec3& /*to_viewer*/, bool /*inside*/)
        : color_(lambertian_color<textured>(scene, scene.materials[material], uv)),
          shading_normal_(shading_normal),
          geometric_normal_(geometric_normal) {}

    BsdfValue evaluate(const glm::vec3& to_light) const {
        const float cosine = glm::dot(shading_normal_, to_light);
        if (!(cosine > 0.0F)) return {glm::vec3(0.0F), 0.0F};
        const bool drawn = glm::dot(geometric_normal_, to_light) > 0.0F;
        return {color_ * (cosine / pi_f), drawn ? cosine / pi_f : 0.0F};
    }

    BsdfSample sample(const glm::vec2& random, float /*choice*/) const {
        const glm::vec3 local = sample_cosine_local(random);
        const glm::vec3 direction = Frame(shading_normal_).to_world(local);
        const bool seen = glm::dot(geometric_normal_, direction) > 0.0F && local.z > 0.0F;
        return {direction, seen ? color_ : glm::vec3(0.0F), local.z / pi_f, false, false};
    }

    const glm::vec3& normal() const { return shading_normal_; }
    glm::vec3 albedo() const { return color_; }
    bool scatters() const { return color_ != glm::vec3(0.0F); }
    bool only_delta() const { return false; }

private:
    glm::vec3 color_, shading_normal_, geometric_normal_;
};

/// One of the ways in which a material scatters light.
struct Lobe {
    enum class Kind { lambert, translucent, glossy, metal, coat, glass, refraction };
    Kind kind;
    float alpha;             ///< of GGX; 0: a mirror
    float eta;               ///< index of refraction beyond the surface, over the viewer's side
    float probability;       ///< with which `sample` takes it
    glm::vec3 reflection;    ///< factor of what is reflected, with what energy is made up for
    glm::vec3 transmission;  ///< factor of what goes through; of a metal its normal reflectance

    bool is_delta() const {
        return kind != Kind::lambert && kind != Kind::translucent && alpha == 0.0F;
    }
};

/// All models.
template <bool textured>
class Bsdf<textured, true> {
public:
    /// Normals are of unit length and on the viewer's side; `to_viewer` is of unit length; `inside`
    /// says that the viewer is on the side from which the triangle's corners run clockwise, where
    /// glass is. A shading normal that the viewer sees from below or at a grazing angle is tilted
    /// towards the viewer until its cosine is least_cosine.
    Bsdf(const Scene& scene, std::uint32_t material, const glm::vec2& uv,
         const glm::vec3& shading_normal, const glm::vec3& geometric_normal,
         const glm::vec3& to_viewer, bool inside);

    BsdfValue evaluate(const glm::vec3& to_light) const;

    /// Takes a lobe by `choice` and draws a direction from it by `random`, all in [0, 1].
    BsdfSample sample(const glm::vec2& random, float choice) const;

    /// The shading normal, tilted where it had to be.
    const glm::vec3& normal() const { return frame_.z; }
    /// Share of light that is reflected or goes through, about; for the albedo pass.
    glm::vec3 albedo() const { return albedo_; }
    /// Otherwise it is black, and paths end.
    bool scatters() const { return count_ > 0; }
    /// Whether directions to lights are of no use.
    bool only_delta() const { return only_delta_; }

private:
    void add(Lobe lobe, const glm::vec3& albedo);
    void add_component(const Scene& scene, const Component& component, const glm::vec2& uv,
                       bool inside);
    void add_principled(const Component& component, const glm::vec3& color, float weight,
                        float roughness, float metallic, float transmission, bool inside);
    void add_diffuse(const glm::vec3& color);
    void add_metal(const glm::vec3& f0, float weight, float roughness);
    void add_glossy(const glm::vec3& color, float weight, float roughness);
    void add_glass(Lobe::Kind kind, const glm::vec3& reflection, const glm::vec3& transmission,
                   float roughness, float ior, bool inside);
    void finish();

    BsdfValue evaluate_local(const glm::vec3& light) const;
    BsdfSample sample_delta(const Lobe& lobe, float choice) const;
    bool is_possible(const glm::vec3& direction, float cosine) const;

    static constexpr std::size_t most_lobes = 1 + 3 * most_components;

    Frame frame_;
    glm::vec3 geometric_normal_;
    glm::vec3 viewer_;  ///< in the frame; z > 0
    glm::vec3 albedo_{0.0F};
    glm::vec3 diffuse_{0.0F};
    std::uint32_t count_ = 0;
    bool only_delta_ = true;
    std::array<Lobe, most_lobes> lobes_;
};

inline constexpr float least_cosine = 1e-4F;

}  // namespace bvhlab
