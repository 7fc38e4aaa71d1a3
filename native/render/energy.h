// SPDX-License-Identifier: GPL-3.0-or-later
// How much light a GGX lobe keeps. Single scattering loses what leaves a microfacet only to meet
// another; the lobes are scaled so that a white one loses nothing (Turquin 2019, "Practical
// multiple scattering compensation for microfacet models").
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace bvhlab {

/// A function of the viewer's cosine and of roughness. Straight between nodes at squares of
/// cosines, which lie close where light grazes, and at even roughnesses.
class EnergyTable {
public:
    static constexpr int cosines = 32, roughnesses = 48;

    float at(float cosine, float roughness) const {
        const float x = std::sqrt(std::clamp(cosine, 0.0F, 1.0F)) * float(cosines - 1);
        const float y = std::clamp(roughness, 0.0F, 1.0F) * float(roughnesses - 1);
        const int column = std::min(int(x), cosines - 2), row = std::min(int(y), roughnesses - 2);
        const float across = x - float(column), down = y - float(row);
        const float* near = &values_[std::size_t(row * cosines + column)];
        const float* far = near + cosines;
        const float first = near[0] + across * (near[1] - near[0]);
        return first + down * (far[0] + across * (far[1] - far[0]) - first);
    }

    static float cosine_of(int column) {
        const float root = float(column) / float(cosines - 1);
        return std::max(root * root, 1e-4F);
    }
    static float roughness_of(int row) { return float(row) / float(roughnesses - 1); }
    float& node(int row, int column) { return values_[std::size_t(row * cosines + column)]; }

private:
    std::array<float, std::size_t(cosines) * std::size_t(roughnesses)> values_;
};

/// Of microfacets that reflect everything.
struct ReflectionEnergy {
    EnergyTable albedo;
    std::array<float, EnergyTable::roughnesses> average;  ///< of albedo, cosine-weighted

    float average_at(float roughness) const;
};

/// Of dielectric microfacets, seen from outside [0] and from inside [1].
struct DielectricEnergy {
    EnergyTable glass[2];    ///< reflected and refracted light together
    EnergyTable refraction;  ///< refracted light alone, from outside
};

/// Light that a dielectric coat reflects, seen from outside.
struct CoatEnergy {
    EnergyTable albedo;
};

/// These are computed once, at first use (tens of milliseconds), and are the same in every run. Any
/// thread may ask. Indices of refraction, 1 to 10, are rounded to a thousandth, which changes an
/// albedo by less than 3e-4.
const ReflectionEnergy& reflection_energy();
const DielectricEnergy& dielectric_energy(float ior);
const CoatEnergy& coat_energy(float ior);

}  // namespace bvhlab
