// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/bsdf.h"

#include <limits>

#include "render/energy.h"
#include "render/material_input.h"

namespace bvhlab {
namespace {

using Kind = Lobe::Kind;

float mean(const glm::vec3& color) {
    return (color.r + color.g + color.b) * (1.0F / 3.0F);
}

/// Factor of a GGX reflection of mean reflectance `average` that adds what is scattered more than
/// once (Kulla & Conty 2017, "Revisiting Physically Based Shading at Imageworks", with Turquin's
/// 2019 shape); 1 / E where all is reflected.
glm::vec3 multiple_scattering(const glm::vec3& average, float cosine, float roughness) {
    const ReflectionEnergy& energy = reflection_energy();
    const float kept = energy.albedo.at(cosine, roughness),
                mean_kept = energy.average_at(roughness);
    const glm::vec3 share = average * mean_kept / (1.0F - average * (1.0F - mean_kept));
    return 1.0F + share * ((1.0F - kept) / kept);
}

/// A float direction cannot resolve normals of rough glass that barely refracts: the rounding of
/// o + eta i is then larger than 1e-3 alpha.
float glass_alpha(float roughness, float ior) {
    const float alpha = roughness * roughness;
    return alpha < least_alpha || alpha * (ior - 1.0F) < 1e-4F ? 0.0F : alpha;
}

/// Below this a coat reflects less than 3e-5 at normal incidence, and is left out.
constexpr float least_coat_ior = 1.01F;

float reflection_alpha(float roughness) {
    const float alpha = roughness * roughness;
    return alpha < least_alpha ? 0.0F : alpha;
}

/// Chance that a dielectric microfacet of this reflectance is sampled as a mirror: by the light
/// that it sends either way.
float mirror_chance(const Lobe& lobe, float reflected) {
    if (reflected >= 1.0F) return 1.0F;
    if (lobe.kind == Kind::refraction) return 0.0F;
    const float mirrored = reflected * mean(lobe.reflection);
    const float through = (1.0F - reflected) * mean(lobe.transmission);
    return mirrored + through > 0.0F ? mirrored / (mirrored + through) : reflected;
}

/// Value and density of one lobe; density without the lobe's probability.
BsdfValue reflect(const Lobe& lobe, const glm::vec3& o, const glm::vec3& i) {
    const glm::vec3 h = glm::normalize(o + i);
    const float density = ggx_density(h, lobe.alpha) / (4.0F * o.z);
    const float value = density * masking_shadowing(o.z, i.z, lobe.alpha);
    const float cosine = std::min(glm::dot(o, h), 1.0F);
    float pdf = density * masking(o.z, lobe.alpha);
    glm::vec3 factor = lobe.reflection;
    if (lobe.kind == Kind::metal) {
        factor *= schlick(lobe.transmission, cosine);
    } else if (lobe.kind == Kind::coat) {
        factor *= dielectric_reflectance(cosine, lobe.eta);
    } else if (lobe.kind == Kind::glass) {
        const float reflected = dielectric_reflectance(cosine, lobe.eta);
        factor *= reflected;
        pdf *= mirror_chance(lobe, reflected);
    }
    return {factor * value, pdf};
}

/// Walter et al. 2007, equations 16 and 17.
BsdfValue refract(const Lobe& lobe, const glm::vec3& o, const glm::vec3& i) {
    glm::vec3 h = glm::normalize(o + lobe.eta * i);
    if (h.z < 0.0F) h = -h;
    const float cos_o = glm::dot(o, h), cos_i = glm::dot(i, h);
    if (!(cos_o > 0.0F) || !(cos_i < 0.0F)) return {glm::vec3(0.0F), 0.0F};
    const float reflected = dielectric_reflectance(std::min(cos_o, 1.0F), lobe.eta);
    const float share = lobe.kind == Kind::glass ? 1.0F - reflected : 1.0F;
    const float chance = 1.0F - mirror_chance(lobe, reflected);
    const float sum = cos_o + lobe.eta * cos_i;
    const float density =
        ggx_density(h, lobe.alpha) * cos_o * -cos_i * lobe.eta * lobe.eta / (o.z * sum * sum);
    return {lobe.transmission * (share * density * masking_shadowing(o.z, -i.z, lobe.alpha)),
            chance * density * masking(o.z, lobe.alpha)};
}

BsdfValue evaluate_lobe(const Lobe& lobe, const glm::vec3& o, const glm::vec3& i) {
    const bool above = i.z > 0.0F;
    switch (lobe.kind) {
        case Kind::lambert:
        case Kind::translucent: {
            const float pdf = std::abs(i.z) / pi_f;
            if (above != (lobe.kind == Kind::lambert)) break;
            return {lobe.reflection * pdf, pdf};
        }
        case Kind::glossy:
        case Kind::metal:
        case Kind::coat:
            if (above && lobe.alpha > 0.0F) return reflect(lobe, o, i);
            break;
        case Kind::glass:
            if (lobe.alpha > 0.0F) return above ? reflect(lobe, o, i) : refract(lobe, o, i);
            break;
        case Kind::refraction:
            if (!above && lobe.alpha > 0.0F) return refract(lobe, o, i);
            break;
    }
    return {glm::vec3(0.0F), 0.0F};
}

/// Draws a direction of a lobe that is no delta; zero where a microfacet sends it nowhere.
glm::vec3 sample_lobe(const Lobe& lobe, const glm::vec3& o, const glm::vec2& random, float choice) {
    if (lobe.kind == Kind::lambert) return sample_cosine_local(random);
    if (lobe.kind == Kind::translucent) return -sample_cosine_local(random);
    const glm::vec3 h = sample_visible_normal(o, lobe.alpha, random);
    const float cosine = std::clamp(glm::dot(o, h), 0.0F, 1.0F);
    if (lobe.kind == Kind::glass || lobe.kind == Kind::refraction) {
        const float reflected = dielectric_reflectance(cosine, lobe.eta);
        if (reflected < 1.0F && choice >= mirror_chance(lobe, reflected)) {
            const glm::vec3 i = refracted(o, h, lobe.eta);
            return i.z < 0.0F ? i : glm::vec3(0.0F);
        }
    }
    const glm::vec3 i = glm::normalize(2.0F * glm::dot(o, h) * h - o);
    return i.z > 0.0F ? i : glm::vec3(0.0F);
}

Frame frame_seen(const glm::vec3& normal, const glm::vec3& to_viewer) {
    const float cosine = glm::dot(normal, to_viewer);
    if (cosine >= least_cosine) return Frame(normal);
    return Frame(glm::normalize(normal + (2.0F * least_cosine - cosine) * to_viewer));
}

}  // namespace

glm::vec3 emission(const Scene& scene, std::uint32_t triangle, const glm::vec2& uv) {
    return value_of<true>(scene, scene.material(triangle).emission, uv,
                          std::numeric_limits<float>::max());
}

glm::vec3 straight_through(const Scene& scene, std::uint32_t triangle, const glm::vec2& uv) {
    glm::vec3 sum(0.0F);
    for (const Component& component : scene.material(triangle).components)
        if (component.model == Model::transparent)
            sum += value_of<true>(scene, component.weight, uv) *
                   value_of<true>(scene, component.color, uv);
    return glm::min(sum, glm::vec3(1.0F));
}

template <bool textured>
glm::vec3 lambertian_color(const Scene& scene, const Material& material, const glm::vec2& uv) {
    glm::vec3 sum(0.0F);
    for (const Component& component : material.components)
        if (component.model != Model::transparent)
            sum += value_of<textured>(scene, component.weight, uv) *
                   value_of<textured>(scene, component.color, uv);
    return glm::min(sum, glm::vec3(1.0F));
}

// --- lobes ---------------------------------------------------------------------------------------

template <bool textured>
Bsdf<textured, true>::Bsdf(const Scene& scene, std::uint32_t material, const glm::vec2& uv,
                           const glm::vec3& shading_normal, const glm::vec3& geometric_normal,
                           const glm::vec3& to_viewer, bool inside)
    : frame_(frame_seen(shading_normal, to_viewer)),
      geometric_normal_(geometric_normal),
      viewer_(frame_.to_local(to_viewer)) {
    viewer_.z = std::clamp(viewer_.z, least_cosine, 1.0F);
    for (const Component& component : scene.materials[material].components)
        add_component(scene, component, uv, inside);
    finish();
}

template <bool textured>
void Bsdf<textured, true>::add_component(const Scene& scene, const Component& component,
                                         const glm::vec2& uv, bool inside) {
    const float weight = value_of<textured>(scene, component.weight, uv);
    if (weight == 0.0F || component.model == Model::transparent) return;
    const glm::vec3 color = value_of<textured>(scene, component.color, uv);
    if (component.model == Model::diffuse) return add_diffuse(weight * color);
    if (component.model == Model::translucent)
        return add({Kind::translucent, 0.0F, 1.0F, 0.0F, weight * color, {}}, weight * color);

    const float roughness = value_of<textured>(scene, component.roughness, uv);
    switch (component.model) {
        case Model::principled:
            add_principled(component, color, weight, roughness,
                           value_of<textured>(scene, component.metallic, uv),
                           value_of<textured>(scene, component.transmission, uv), inside);
            break;
        case Model::glossy:
            add_glossy(color, weight, roughness);
            break;
        case Model::glass:
            add_glass(Kind::glass, weight * color, weight * color, roughness, component.ior,
                      inside);
            break;
        case Model::refraction:
            add_glass(Kind::refraction, glm::vec3(0.0F), weight * color, roughness, component.ior,
                      inside);
            break;
        default:
            break;
    }
}

/// A mix as in Blender 4's node: metal, else glass whose reflection is white and which light tints
/// by `color` where it passes two surfaces, else a diffuse base under a dielectric coat, which
/// receives what the coat does not reflect.
template <bool textured>
void Bsdf<textured, true>::add_principled(const Component& component, const glm::vec3& color,
                                          float weight, float roughness, float metallic,
                                          float transmission, bool inside) {
    if (metallic > 0.0F) add_metal(color, weight * metallic, roughness);
    const float glass = weight * (1.0F - metallic) * transmission;
    if (glass > 0.0F)
        add_glass(Kind::glass, glm::vec3(glass), glass * glm::sqrt(color), roughness, component.ior,
                  inside);

    const float base = weight * (1.0F - metallic) * (1.0F - transmission);
    if (base == 0.0F) return;
    const float ior = scaled_ior(component.ior, component.specular);
    if (ior < least_coat_ior) return add_diffuse(base * color);
    const float alpha = reflection_alpha(roughness);
    const float albedo = alpha == 0.0F ? dielectric_reflectance(viewer_.z, ior)
                                       : coat_energy(ior).albedo.at(viewer_.z, roughness);
    add({Kind::coat, alpha, ior, 0.0F, glm::vec3(base), {}}, glm::vec3(base * albedo));
    add_diffuse(base * (1.0F - albedo) * color);
}

template <bool textured>
void Bsdf<textured, true>::add_diffuse(const glm::vec3& color) {
    diffuse_ += color;
}

template <bool textured>
void Bsdf<textured, true>::add_glossy(const glm::vec3& color, float weight, float roughness) {
    const float alpha = reflection_alpha(roughness);
    glm::vec3 factor = weight * color;
    if (alpha > 0.0F) factor *= multiple_scattering(color, viewer_.z, roughness);
    add({Kind::glossy, alpha, 1.0F, 0.0F, factor, {}}, weight * color);
}

template <bool textured>
void Bsdf<textured, true>::add_metal(const glm::vec3& f0, float weight, float roughness) {
    const float alpha = reflection_alpha(roughness);
    glm::vec3 factor(weight);
    const glm::vec3 mean_reflectance = f0 + (1.0F - f0) / 21.0F;  // the integral of 2 cos F
    if (alpha > 0.0F) factor *= multiple_scattering(mean_reflectance, viewer_.z, roughness);
    const glm::vec3 seen = glm::max(schlick(f0, viewer_.z), mean_reflectance);
    add({Kind::metal, alpha, 1.0F, 0.0F, factor, f0}, weight * seen);
}

template <bool textured>
void Bsdf<textured, true>::add_glass(Kind kind, const glm::vec3& reflection,
                                     const glm::vec3& transmission, float roughness, float ior,
                                     bool inside) {
    const float alpha = glass_alpha(roughness, ior);
    float factor = 1.0F;
    if (alpha > 0.0F && kind == Kind::glass)
        factor = 1.0F / dielectric_energy(ior).glass[inside].at(viewer_.z, roughness);
    // From inside most light may be totally reflected, which refraction alone leaves out.
    if (alpha > 0.0F && kind == Kind::refraction && !inside)
        factor = 1.0F / dielectric_energy(ior).refraction.at(viewer_.z, roughness);
    const float eta = inside ? 1.0F / ior : ior;
    const float reflected = kind == Kind::glass ? dielectric_reflectance(viewer_.z, eta) : 0.0F;
    add({kind, alpha, eta, 0.0F, factor * reflection, factor * transmission},
        glm::mix(transmission, reflection, reflected));
}

template <bool textured>
void Bsdf<textured, true>::add(Lobe lobe, const glm::vec3& albedo) {
    lobe.probability = mean(albedo);
    if (!(lobe.probability > 0.0F)) return;
    albedo_ += albedo;
    only_delta_ = only_delta_ && lobe.is_delta();
    lobes_[count_++] = lobe;
}

/// Adds all that is diffuse as one lobe, and turns shares of light into probabilities.
template <bool textured>
void Bsdf<textured, true>::finish() {
    add({Kind::lambert, 0.0F, 1.0F, 0.0F, diffuse_, {}}, diffuse_);
    float sum = 0.0F;
    for (std::uint32_t i = 0; i < count_; ++i) sum += lobes_[i].probability;
    for (std::uint32_t i = 0; i < count_; ++i) lobes_[i].probability /= sum;
}

// --- directions ----------------------------------------------------------------------------------

/// Whether light in this direction is on the same side of the triangle as of the shading normal.
template <bool textured>
bool Bsdf<textured, true>::is_possible(const glm::vec3& direction, float cosine) const {
    return glm::dot(geometric_normal_, direction) * cosine > 0.0F;
}

template <bool textured>
BsdfValue Bsdf<textured, true>::evaluate_local(const glm::vec3& light) const {
    BsdfValue sum{glm::vec3(0.0F), 0.0F};
    for (std::uint32_t i = 0; i < count_; ++i) {
        const BsdfValue one = evaluate_lobe(lobes_[i], viewer_, light);
        sum.value += one.value;
        sum.pdf += lobes_[i].probability * one.pdf;
    }
    return sum;
}

template <bool textured>
BsdfValue Bsdf<textured, true>::evaluate(const glm::vec3& to_light) const {
    const glm::vec3 light = frame_.to_local(to_light);
    const bool possible = is_possible(to_light, light.z);
    if (!possible && !(light.z > 0.0F)) return {glm::vec3(0.0F), 0.0F};
    BsdfValue value = evaluate_local(light);
    if (!possible) value.pdf = 0.0F;  // `sample` leaves it out
    return value;
}

template <bool textured>
BsdfSample Bsdf<textured, true>::sample_delta(const Lobe& lobe, float choice) const {
    const glm::vec3 mirrored(-viewer_.x, -viewer_.y, viewer_.z), straight(0.0F, 0.0F, 1.0F);
    glm::vec3 light = mirrored, weight = lobe.reflection;
    if (lobe.kind == Kind::metal) weight *= schlick(lobe.transmission, viewer_.z);
    if (lobe.kind == Kind::coat) weight *= dielectric_reflectance(viewer_.z, lobe.eta);
    if (lobe.kind == Kind::glass || lobe.kind == Kind::refraction) {
        const float reflected = dielectric_reflectance(viewer_.z, lobe.eta);
        const float chance = mirror_chance(lobe, reflected);
        if (reflected < 1.0F && choice >= chance) {
            light = refracted(viewer_, straight, lobe.eta);
            const float share = lobe.kind == Kind::glass ? 1.0F - reflected : 1.0F;
            weight = lobe.transmission * (share / (1.0F - chance));
        } else {
            weight *= reflected / chance;
        }
    }
    const glm::vec3 direction = glm::normalize(frame_.to_world(light));
    if (!is_possible(direction, light.z)) weight = glm::vec3(0.0F);
    return {direction, weight / lobe.probability, 0.0F, true, light.z < 0.0F};
}

template <bool textured>
BsdfSample Bsdf<textured, true>::sample(const glm::vec2& random, float choice) const {
    // Take the lobe, and use what is left of the random number within its share.
    std::uint32_t taken = 0;
    float left = choice;
    while (taken + 1 < count_ && left >= lobes_[taken].probability)
        left -= lobes_[taken++].probability;
    const Lobe& lobe = lobes_[taken];
    const float rest = std::clamp(left / lobe.probability, 0.0F, 1.0F);
    if (lobe.is_delta()) return sample_delta(lobe, rest);

    // Draw a direction, and see which lobes could have drawn it.
    const glm::vec3 light = sample_lobe(lobe, viewer_, random, rest);
    const BsdfSample nowhere{frame_.z, glm::vec3(0.0F), 0.0F, false, false};
    if (light.z == 0.0F) return nowhere;
    const glm::vec3 direction = glm::normalize(frame_.to_world(light));
    if (!is_possible(direction, light.z)) return nowhere;
    const BsdfValue value = evaluate_local(light);
    if (!(value.pdf > 0.0F)) return nowhere;
    return {direction, value.value / value.pdf, value.pdf, false, light.z < 0.0F};
}

template glm::vec3 lambertian_color<false>(const Scene&, const Material&, const glm::vec2&);
template glm::vec3 lambertian_color<true>(const Scene&, const Material&, const glm::vec2&);
template class Bsdf<false, true>;
template class Bsdf<true, true>;

}  // namespace bvhlab
