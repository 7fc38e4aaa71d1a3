// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/mat3x2.hpp>
#include <glm/vec3.hpp>
#include <vector>

namespace bvhlab {

enum class Channel { rgb, red, green, blue, alpha, luminance };

/// A value that a texture varies over a surface: offset + scale * texel.
struct Lookup {
    std::uint32_t texture = 0;       ///< into Scene::textures
    Channel channel = Channel::rgb;  ///< a single channel fills all three of a colour
    glm::vec3 scale{1.0F}, offset{0.0F};
    glm::mat3x2 mapping{1.0F};  ///< texture coordinates are mapping * (u, v, 1)
};

inline constexpr std::uint32_t no_lookup = 0xFFFFFFFFU;

/// A constant colour, linear RGB, or one that is looked up in Scene::lookups.
struct ColorInput {
    glm::vec3 value{0.0F};
    std::uint32_t lookup = no_lookup;
};

/// A constant number or one that is looked up (`Lookup::channel` other than rgb).
struct NumberInput {
    float value = 0.0F;
    std::uint32_t lookup = no_lookup;
};

/// How a component scatters. All but `principled` have the meaning of Blender's node of that name.
enum class Model {
    principled,   ///< metal, glass, or a rough dielectric coat on a diffuse base, mixed
    diffuse,      ///< Lambertian reflection of `color`
    glossy,       ///< GGX reflection of `color` at every angle
    glass,        ///< GGX reflection and refraction by `ior`, both tinted by `color`
    refraction,   ///< GGX refraction by `ior` alone, tinted by `color`
    translucent,  ///< Lambertian transmission of `color`
    transparent,  ///< straight through, tinted by `color`: what alpha cuts out
};

/// One part of a material. Numbers are clamped to their range after look-up.
struct Component {
    Model model = Model::diffuse;
    NumberInput weight{1.0F};           ///< [0, 1]
    ColorInput color{glm::vec3(0.8F)};  ///< [0, 1] each
    NumberInput roughness{0.5F};        ///< [0, 1]; GGX alpha is its square; not of diffuse models
    NumberInput metallic{0.0F};         ///< [0, 1]; principled only
    NumberInput transmission{0.0F};     ///< [0, 1]; principled only
    float ior = 1.45F;                  ///< 1 to 10; principled, glass, refraction
    float specular = 1.0F;  ///< principled: factor of the coat's normal reflectance; 0 is no coat
};

inline constexpr float most_specular = 2.0F;

inline constexpr std::size_t most_components = 4;

/// What a surface does with light; both sides are alike. Components add up: their weights should
/// sum to at most 1.
struct Material {
    std::vector<Component> components{Component{}};  ///< none (black) to most_components
    ColorInput
        emission{};  ///< radiance, W/(m2 sr), after look-up clamped to be finite, not negative
};

/// These throw std::invalid_argument saying what is not finite or out of its range. That lookups
/// exist is for make_scene to check.
void check_lookup(const Lookup& lookup);
void check_component(const Component& component);
void check_emission(const glm::vec3& emission);

/// Whether it is nothing but Lambertian reflection of its colour.
bool is_lambertian(const Component& component);

}  // namespace bvhlab
