// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>

#include "opencl/commands.h"
#include "render/light_sampling.h"
#include "scene/scene.h"

namespace bvhlab::opencl {

inline constexpr std::uint32_t no_table = 0xFFFFFFFFU;

// --- as kernels/scene.cl declares them, member for member ---------------------------------------

struct DeviceTexture {
    std::uint64_t first;  ///< of its values
    std::uint32_t width, height, channels;
    std::uint32_t has_bytes, srgb, closest, wrap;
    std::uint32_t unused;
};

struct DeviceLookup {
    std::uint32_t texture, channel;
    float scale[3], offset[3], mapping[6];
};

struct DeviceComponent {
    std::uint32_t model;
    NumberInput weight;
    ColorInput color;
    NumberInput roughness, metallic, transmission;
    float ior;
    float coat_ior;             ///< whose normal reflectance is scaled by `specular`
    std::uint32_t coat_table;   ///< of energy, or no_table
    std::uint32_t glass_table;  ///< first of three, or no_table
};

struct DeviceMaterial {
    std::uint32_t first_component, components;
    ColorInput emission;
};

struct DeviceLamp {
    glm::dvec3 centre, back, edge_x, edge_y, unit_x, unit_y;
    glm::dvec2 size;
    glm::dvec3 strength;
    double reach, extent, luminance, spot_edge, spot_blended;
    std::uint32_t kind, ellipse, right_angled, unused;
};

struct DeviceExtendedLamp {
    double share;
    std::uint32_t lamp, entry;
};

struct DeviceDistribution {
    std::uint64_t first_weight = 0, first_sum = 0, sums = 0;
};

struct SceneConstants {
    glm::dvec3 emitters_centre;
    double emitters_power, emitters_radius;
    double world_brightness;
    double always[5];
    glm::dmat3 to_texture;
    double environment_weight;
    DeviceDistribution lamps_by_power, suns_by_power, emitters_by_power, environment_rows;
    glm::vec3 world;
    std::uint32_t world_texture;
    std::uint32_t lamps, suns, emitters, extended;
};

static_assert(sizeof(DeviceTexture) == 40 && sizeof(DeviceLookup) == 56);
static_assert(sizeof(DeviceComponent) == 68 && sizeof(DeviceMaterial) == 24);
static_assert(sizeof(DeviceLamp) == 240 && sizeof(SceneConstants) == 296);

// --- a scene ------------------------------------------------------------------------------------

/// Where light comes from.
struct LightBuffers {
    Buffer<DeviceLamp> lamps;  ///< and then suns
    Buffer<DeviceExtendedLamp> extended;
    Buffer<std::uint32_t> emitters;
    Buffer<double> emitter_density;  ///< by material
    Buffer<float> weights;           ///< of distributions
    Buffer<double> sums;             ///< of their blocks
    Buffer<float> environment_weights;
    Buffer<double> environment_sums;
};

/// A scene on a device: what its features need and nothing more; the other buffers are empty.
struct SceneBuffers {
    Buffer<SceneConstants> constants;
    Buffer<glm::vec3> vertices;
    Buffer<glm::uvec3> triangles;
    Buffer<std::uint32_t> material_index;
    Buffer<DeviceMaterial> materials;
    Buffer<DeviceComponent> components;
    Buffer<DeviceLookup> lookups;
    Buffer<DeviceTexture> textures;
    Buffer<std::uint8_t> texture_bytes;
    Buffer<float> texture_floats;
    Buffer<float> decoded;
    Buffer<glm::vec2> uvs;
    Buffer<glm::vec3> normals;
    Buffer<float> energy;
    LightBuffers lights;

    /// Build options of the programs that shade it (kernels/shade.cl).
    std::string options;
    /// Whether there is anything to sample.
    bool has_lights = false;
};

/// Copies what shading the scene needs. Throws MemoryError where it does not fit.
SceneBuffers upload_scene(Commands& commands, const Scene& scene, const LightSampler& lights);

/// The lights' part of it; adds to `constants` and `options`.
LightBuffers upload_lights(Commands& commands, const Scene& scene, const LightSampler& lights,
                           SceneConstants& constants, SceneBuffers& buffers);

}  // namespace bvhlab::opencl
