// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "base/array.h"
#include "scene/light.h"
#include "scene/material.h"
#include "scene/mesh.h"
#include "scene/texture.h"

namespace bvhlab {

inline constexpr std::uint32_t no_texture = 0xFFFFFFFFU;

/// The background: a constant radiance, or an equirectangular picture times `color`.
struct World {
    glm::vec3 color{0.0F};               ///< radiance, linear RGB; factor of the texture
    std::uint32_t texture = no_texture;  ///< into Scene::textures
    glm::dmat3 to_texture{1.0};  ///< rotation of world directions into the picture's: +Z is up, the
                                 ///< picture's centre lies at +X, as in Blender
};

/// The parts of a scene as they are handed over.
struct SceneParts {
    std::shared_ptr<const Mesh> mesh;
    std::vector<Material> materials;
    Array<std::uint32_t> material_index;  ///< into materials, by triangle
    std::vector<Light> lights{};
    World world{};
    std::vector<std::shared_ptr<const Texture>> textures{};
    std::vector<Lookup> lookups{};  ///< into textures
    Array<glm::vec2> uvs{};         ///< three corners for each triangle; empty: no coordinates
    Array<glm::vec3> normals{};     ///< three corners for each triangle, unit; empty: all flat
};

/// What a scene uses: what is not used is neither computed nor compiled in.
struct Features {
    bool textures = false;      ///< a material looks something up
    bool smooth = false;        ///< corner normals
    bool gloss = false;         ///< any GGX lobe or translucency: not all is Lambertian reflection
    bool transmission = false;  ///< light passes through surfaces (glass, refraction, translucent)
    bool transparency = false;  ///< surfaces that rays pass straight through
    bool emitters = false;      ///< emitting triangles
    bool lamps = false;
    bool world = false;        ///< a background that is not black
    bool environment = false;  ///< of which a texture
};

/// What a picture is made of. Once made it is trusted: indices in range, numbers finite.
struct Scene : SceneParts {
    Features features;

    const Material& material(std::uint32_t triangle) const {
        return materials[material_index[triangle]];
    }
};

/// Checks the parts, finds the features and puts all together.
/// Throws std::invalid_argument naming the first bad material, triangle, texture or light.
Scene make_scene(SceneParts parts);

}  // namespace bvhlab
