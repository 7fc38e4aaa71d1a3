// SPDX-License-Identifier: GPL-3.0-or-later
// GGX microfacets and Fresnel's equations, in the frame of the shading normal: z is along it, and
// `o` is the unit direction to the viewer with o.z > 0.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <numbers>

namespace bvhlab {

inline constexpr float pi_f = std::numbers::pi_v<float>;

/// A right-handed frame about the unit vector z (Duff et al. 2017, "Building an Orthonormal Basis,
/// Revisited").
struct Frame {
    glm::vec3 x, y, z;

    explicit Frame(const glm::vec3& axis) : z(axis) {
        const float sign = std::copysign(1.0F, z.z);
        const float a = -1.0F / (sign + z.z);
        const float b = z.x * z.y * a;
        x = {1.0F + sign * z.x * z.x * a, sign * b, -sign * z.x};
        y = {b, sign + z.y * z.y * a, -z.y};
    }

    glm::vec3 to_local(const glm::vec3& v) const {
        return {glm::dot(v, x), glm::dot(v, y), glm::dot(v, z)};
    }
    glm::vec3 to_world(const glm::vec3& v) const { return v.x * x + v.y * y + v.z * z; }
};

/// Unit direction about +z with density cos / pi (Shirley & Chiu 1997, concentric map).
inline glm::vec3 sample_cosine_local(const glm::vec2& random) {
    const glm::vec2 square = 2.0F * random - 1.0F;
    if (square.x == 0.0F && square.y == 0.0F) return {0.0F, 0.0F, 1.0F};
    const bool wide = std::abs(square.x) > std::abs(square.y);
    const float radius = wide ? square.x : square.y;
    const float angle = wide ? pi_f / 4.0F * (square.y / square.x)
                             : pi_f / 2.0F - pi_f / 4.0F * (square.x / square.y);
    return {radius * std::cos(angle), radius * std::sin(angle),
            std::sqrt(std::max(0.0F, 1.0F - radius * radius))};
}

// --- GGX -----------------------------------------------------------------------------------------

/// Below this alpha a surface is a mirror: as in Cycles, alpha^2 of 5e-7. Float directions resolve
/// its highlight to about 1e-4.
inline constexpr float least_alpha = 7e-4F;

/// Trowbridge & Reitz 1975 (Walter et al. 2007, equation 33); h is a unit vector. From its sine, as
/// 1 - cos^2 would lose all digits where alpha is small.
inline float ggx_density(const glm::vec3& h, float alpha) {
    const float squared = alpha * alpha;
    const float slope = h.x * h.x + h.y * h.y + h.z * h.z * squared;
    return squared / (pi_f * slope * slope);
}

/// cos * (1 + 2 Lambda), with Smith's Lambda for GGX (Heitz 2014, equation 72).
inline float smith_term(float cosine, float alpha) {
    const float squared = cosine * cosine;
    return std::sqrt(squared + alpha * alpha * (1.0F - squared));
}

/// Smith's masking of one direction, cosine > 0.
inline float masking(float cosine, float alpha) {
    return 2.0F * cosine / (cosine + smith_term(cosine, alpha));
}

/// Height-correlated masking and shadowing (Heitz 2014, equation 99), cosines > 0. It serves
/// transmission too.
inline float masking_shadowing(float cos_o, float cos_i, float alpha) {
    return 2.0F * cos_o * cos_i /
           (cos_i * smith_term(cos_o, alpha) + cos_o * smith_term(cos_i, alpha));
}

/// A microfacet normal that o sees: `stretched` is o as a surface of alpha 1 would see it, `turn` a
/// unit vector of uniform angle and `height` uniform in [0, 1] (Dupuy & Benyoub 2023, "Sampling
/// Visible GGX Normals with Spherical Caps").
inline glm::vec3 visible_normal(const glm::vec3& stretched, float alpha, const glm::vec2& turn,
                                float height) {
    const float z = (1.0F - height) * (1.0F + stretched.z) - stretched.z;
    const float sine = std::sqrt(std::clamp(1.0F - z * z, 0.0F, 1.0F));
    const glm::vec3 h = stretched + glm::vec3(sine * turn, z);
    return glm::normalize(glm::vec3(alpha * h.x, alpha * h.y, std::max(h.z, 1e-9F)));
}

inline glm::vec3 stretch(const glm::vec3& o, float alpha) {
    return glm::normalize(glm::vec3(alpha * o.x, alpha * o.y, o.z));
}

inline glm::vec3 sample_visible_normal(const glm::vec3& o, float alpha, const glm::vec2& random) {
    const float angle = 2.0F * pi_f * random.x;
    return visible_normal(stretch(o, alpha), alpha, {std::cos(angle), std::sin(angle)}, random.y);
}

// --- Fresnel -------------------------------------------------------------------------------------

/// Reflectance of a dielectric for unpolarised light; `eta` is the index of refraction beyond the
/// surface over that on the viewer's side, `cosine` in [0, 1] the viewer's. 1 on total reflection.
inline float dielectric_reflectance(float cosine, float eta) {
    const float squared = eta * eta - (1.0F - cosine * cosine);
    if (squared <= 0.0F) return 1.0F;
    const float beyond = std::sqrt(squared);  // eta times the cosine beyond
    const float perpendicular = (cosine - beyond) / (cosine + beyond);
    const float parallel = (eta * eta * cosine - beyond) / (eta * eta * cosine + beyond);
    return 0.5F * (perpendicular * perpendicular + parallel * parallel);
}

/// Schlick 1994.
inline glm::vec3 schlick(const glm::vec3& f0, float cosine) {
    const float x = std::clamp(1.0F - cosine, 0.0F, 1.0F);
    const float x2 = x * x;
    return f0 + (1.0F - f0) * (x2 * x2 * x);
}

/// The index of refraction whose normal reflectance is `factor` times that of `ior`.
inline float scaled_ior(float ior, float factor) {
    if (factor == 1.0F) return ior;
    const float root = (ior - 1.0F) / (ior + 1.0F);
    const float scaled = std::min(std::sqrt(factor) * root, 9.0F / 11.0F);  // an ior of 10
    return (1.0F + scaled) / (1.0F - scaled);
}

/// The refracted direction beyond a microfacet h with dot(o, h) > 0. Requires that there is no
/// total reflection.
inline glm::vec3 refracted(const glm::vec3& o, const glm::vec3& h, float eta) {
    const float cosine = glm::dot(o, h);
    const float beyond = std::sqrt(std::max(0.0F, eta * eta - (1.0F - cosine * cosine)));
    return glm::normalize(((cosine - beyond) * h - o) / eta);
}

}  // namespace bvhlab
