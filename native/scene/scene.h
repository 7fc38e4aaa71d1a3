// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/array.h"
#include "scene/light.h"
#include "scene/material.h"
#include "scene/mesh.h"

namespace bvhlab {

/// What a picture is made of. Once made it is trusted: one material index in range per triangle,
/// colours finite and not negative.
struct Scene {
    std::shared_ptr<const Mesh> mesh;
    std::vector<Material> materials;
    Array<std::uint32_t> material_index;  ///< into materials, by triangle
    std::vector<Light> lights;
    glm::vec3 world{0.0F};  ///< radiance of the constant background, linear RGB

    const Material& material(std::uint32_t triangle) const {
        return materials[material_index[triangle]];
    }
};

/// Checks the parts and puts them together.
/// Throws std::invalid_argument naming the first bad material, triangle or light.
Scene make_scene(std::shared_ptr<const Mesh> mesh, std::vector<Material> materials,
                 Array<std::uint32_t> material_index, std::vector<Light> lights,
                 const glm::vec3& world);

}  // namespace bvhlab
