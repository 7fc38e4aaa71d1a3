// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "scene/color.h"

namespace bvhlab {
namespace {

bool is_reflectance(const glm::vec3& color) {
    return is_radiance(color) && color.r <= 1.0F && color.g <= 1.0F && color.b <= 1.0F;
}

void check_materials(const std::vector<Material>& materials) {
    if (materials.empty()) throw std::invalid_argument("the scene needs at least one material");
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const std::string name = "material " + std::to_string(i);
        if (!is_reflectance(materials[i].base_color))
            throw std::invalid_argument(name + " has base_color " +
                                        color_text(materials[i].base_color) +
                                        ": each channel must be 0 to 1");
        if (!is_radiance(materials[i].emission))
            throw std::invalid_argument(name + " has emission " +
                                        color_text(materials[i].emission) +
                                        ": it must be finite and not negative");
    }
}

void check_material_index(const Array<std::uint32_t>& material_index, std::size_t triangles,
                          std::size_t materials) {
    if (material_index.size() != triangles)
        throw std::invalid_argument("material_index has " + std::to_string(material_index.size()) +
                                    " entries for " + std::to_string(triangles) + " triangles");
    for (std::size_t i = 0; i < triangles; ++i)
        if (material_index[i] >= materials)
            throw std::invalid_argument("triangle " + std::to_string(i) + " has material " +
                                        std::to_string(material_index[i]) +
                                        ", but there are only " + std::to_string(materials) +
                                        " materials");
}

void check_lights(const std::vector<Light>& lights) {
    for (std::size_t i = 0; i < lights.size(); ++i) {
        try {
            check_light(lights[i]);
        } catch (const std::invalid_argument& error) {
            throw std::invalid_argument("light " + std::to_string(i) + ": " + error.what());
        }
    }
}

}  // namespace

Scene make_scene(std::shared_ptr<const Mesh> mesh, std::vector<Material> materials,
                 Array<std::uint32_t> material_index, std::vector<Light> lights,
                 const glm::vec3& world) {
    check_materials(materials);
    check_material_index(material_index, mesh->size(), materials.size());
    check_lights(lights);
    if (!is_radiance(world))
        throw std::invalid_argument("the world's color is " + color_text(world) +
                                    ": it must be finite and not negative");
    return {std::move(mesh), std::move(materials), std::move(material_index), std::move(lights),
            world};
}

}  // namespace bvhlab
