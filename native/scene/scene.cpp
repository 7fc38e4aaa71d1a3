// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "scene/color.h"

namespace bvhlab {
namespace {

[[noreturn]] void refuse(const std::string& what) {
    throw std::invalid_argument(what);
}

/// Calls `check`, and puts the name of the checked thing before its complaint.
template <class Check>
void check_named(const std::string& name, const Check& check) {
    try {
        check();
    } catch (const std::invalid_argument& error) {
        refuse(name + ": " + error.what());
    }
}

std::string numbered(const char* name, std::size_t index) {
    return std::string(name) + " " + std::to_string(index);
}

// --- materials -----------------------------------------------------------------------------------

void check_input(const SceneParts& parts, const char* name, std::uint32_t lookup, bool is_color) {
    if (lookup == no_lookup) return;
    if (lookup >= parts.lookups.size())
        refuse(std::string(name) + " is lookup " + std::to_string(lookup) +
               ", but there are only " + std::to_string(parts.lookups.size()) + " lookups");
    if (!is_color && parts.lookups[lookup].channel == Channel::rgb)
        refuse(std::string(name) +
               " is a number, but its lookup reads all of a colour: choose one channel");
    if (parts.uvs.empty())
        refuse(std::string(name) + " looks up texture " +
               std::to_string(parts.lookups[lookup].texture) + ", but the scene has no uvs");
}

void check_component_of(const SceneParts& parts, const Component& component) {
    check_component(component);
    check_input(parts, "weight", component.weight.lookup, false);
    check_input(parts, "color", component.color.lookup, true);
    check_input(parts, "roughness", component.roughness.lookup, false);
    check_input(parts, "metallic", component.metallic.lookup, false);
    check_input(parts, "transmission", component.transmission.lookup, false);
}

void check_materials(const SceneParts& parts) {
    if (parts.materials.empty()) refuse("the scene needs at least one material");
    for (std::size_t i = 0; i < parts.materials.size(); ++i) {
        const Material& material = parts.materials[i];
        const std::string name = numbered("material", i);
        if (material.components.size() > most_components)
            refuse(name + " has " + std::to_string(material.components.size()) +
                   " components; at most " + std::to_string(most_components) + " are supported");
        for (std::size_t j = 0; j < material.components.size(); ++j)
            check_named(name + ", component " + std::to_string(j),
                        [&] { check_component_of(parts, material.components[j]); });
        check_named(name, [&] {
            check_emission(material.emission.value);
            check_input(parts, "emission", material.emission.lookup, true);
        });
    }
}

void check_material_index(const SceneParts& parts) {
    const std::size_t triangles = parts.mesh->size(), materials = parts.materials.size();
    if (parts.material_index.size() != triangles)
        refuse("material_index has " + std::to_string(parts.material_index.size()) +
               " entries for " + std::to_string(triangles) + " triangles");
    for (std::size_t i = 0; i < triangles; ++i)
        if (parts.material_index[i] >= materials)
            refuse(numbered("triangle", i) + " has material " +
                   std::to_string(parts.material_index[i]) + ", but there are only " +
                   std::to_string(materials) + " materials");
}

// --- textures ------------------------------------------------------------------------------------

void check_textures(const SceneParts& parts) {
    for (std::size_t i = 0; i < parts.textures.size(); ++i) {
        if (!parts.textures[i]) refuse(numbered("texture", i) + " is missing");
        check_named(numbered("texture", i), [&] { check_texture(*parts.textures[i]); });
    }
    for (std::size_t i = 0; i < parts.lookups.size(); ++i) {
        check_named(numbered("lookup", i), [&] { check_lookup(parts.lookups[i]); });
        if (parts.lookups[i].texture >= parts.textures.size())
            refuse(numbered("lookup", i) + " refers to texture " +
                   std::to_string(parts.lookups[i].texture) + ", but there are only " +
                   std::to_string(parts.textures.size()) + " textures");
    }
}

// --- corners -------------------------------------------------------------------------------------

void check_corner_count(const char* name, std::size_t corners, std::size_t triangles) {
    if (corners != 0 && corners != 3 * triangles)
        refuse(std::string(name) + " has " + std::to_string(corners) + " corners for " +
               std::to_string(triangles) + " triangles; there must be three for each");
}

std::string corner_text(std::size_t corner) {
    return numbered("triangle", corner / 3) + ", corner " + std::to_string(corner % 3);
}

void check_corners(const SceneParts& parts) {
    check_corner_count("uvs", parts.uvs.size(), parts.mesh->size());
    for (std::size_t i = 0; i < parts.uvs.size(); ++i)
        if (!std::isfinite(parts.uvs[i].x) || !std::isfinite(parts.uvs[i].y))
            refuse(corner_text(i) + " has uv (" + std::to_string(parts.uvs[i].x) + ", " +
                   std::to_string(parts.uvs[i].y) + "): it must be finite");
    check_corner_count("normals", parts.normals.size(), parts.mesh->size());
    for (std::size_t i = 0; i < parts.normals.size(); ++i) {
        const double length = glm::length(glm::dvec3(parts.normals[i]));
        if (!(std::abs(length - 1.0) <= 1e-3))
            refuse(corner_text(i) + " has normal " + color_text(parts.normals[i]) +
                   ": it must have unit length");
    }
}

// --- lights --------------------------------------------------------------------------------------

bool is_rotation(const glm::dmat3& matrix) {
    const glm::dmat3 product = glm::transpose(matrix) * matrix;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            if (!(std::abs(product[column][row] - (column == row ? 1.0 : 0.0)) <= 1e-4))
                return false;
    return true;
}

void check_world(const SceneParts& parts) {
    if (!is_radiance(parts.world.color))
        refuse("the world's color is " + color_text(parts.world.color) +
               ": it must be finite and not negative");
    if (parts.world.texture == no_texture) return;
    if (parts.world.texture >= parts.textures.size())
        refuse("the world refers to texture " + std::to_string(parts.world.texture) +
               ", but there are only " + std::to_string(parts.textures.size()) + " textures");
    if (!is_rotation(parts.world.to_texture))
        refuse(
            "the world's to_texture must be a rotation: a (3, 3) matrix with axes of unit "
            "length at right angles");
}

void check_lights(const std::vector<Light>& lights) {
    for (std::size_t i = 0; i < lights.size(); ++i)
        check_named(numbered("light", i), [&] { check_light(lights[i]); });
}

// --- features ------------------------------------------------------------------------------------

void add_component(const Component& component, Features& features) {
    const auto is_zero = [](const NumberInput& input) {
        return input.lookup == no_lookup && input.value == 0.0F;
    };
    if (is_zero(component.weight)) return;
    for (const std::uint32_t lookup :
         {component.weight.lookup, component.color.lookup, component.roughness.lookup,
          component.metallic.lookup, component.transmission.lookup})
        features.textures |= lookup != no_lookup;
    if (component.model == Model::transparent) {
        features.transparency = true;
        return;
    }
    features.gloss |= !is_lambertian(component);
    features.transmission |=
        component.model == Model::glass || component.model == Model::refraction ||
        component.model == Model::translucent ||
        (component.model == Model::principled && !is_zero(component.transmission));
}

bool may_emit(const SceneParts& parts, const ColorInput& emission) {
    if (emission.lookup == no_lookup) return !is_black(emission.value);
    const Lookup& lookup = parts.lookups[emission.lookup];
    return !is_black(lookup.scale) || !is_black(lookup.offset);
}

/// Of materials only those that a triangle has count.
Features find_features(const SceneParts& parts) {
    std::vector<bool> used(parts.materials.size(), false);
    for (const std::uint32_t material : parts.material_index) used[material] = true;
    Features features;
    for (std::size_t i = 0; i < used.size(); ++i) {
        if (!used[i]) continue;
        const Material& material = parts.materials[i];
        for (const Component& component : material.components) add_component(component, features);
        if (!may_emit(parts, material.emission)) continue;
        features.emitters = true;
        features.textures |= material.emission.lookup != no_lookup;
    }
    features.smooth = !parts.normals.empty();
    features.lamps = !parts.lights.empty();
    features.world = !is_black(parts.world.color);
    features.environment = features.world && parts.world.texture != no_texture;
    return features;
}

}  // namespace

Scene make_scene(SceneParts parts) {
    if (!parts.mesh) refuse("the scene has no mesh");
    check_textures(parts);
    check_corners(parts);
    check_materials(parts);
    check_material_index(parts);
    check_lights(parts.lights);
    check_world(parts);
    const Features features = find_features(parts);
    if (!features.textures) parts.uvs = {};
    return {std::move(parts), features};
}

}  // namespace bvhlab
