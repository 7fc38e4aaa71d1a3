// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "python/convert.h"
#include "scene/material.h"

namespace bvhlab {

/// A component as Python holds it: with its lookups, which the scene will number.
struct PyComponent {
    Component component;
    std::optional<Lookup> weight, color, roughness, metallic, transmission;
};

struct PyMaterial {
    std::vector<PyComponent> components;
    glm::vec3 emission;
    std::optional<Lookup> emission_lookup;
};

/// The material with its lookups appended to `lookups`.
Material with_lookups(const PyMaterial& material, std::vector<Lookup>& lookups);

void bind_material(py::module_& module);  // Texture, Lookup, Component, Material

}  // namespace bvhlab
