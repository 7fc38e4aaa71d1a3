// SPDX-License-Identifier: GPL-3.0-or-later
// Camera, Light, World, Scene.
#include <pybind11/stl.h>

#include <glm/vec2.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "python/arguments.h"
#include "python/material_arguments.h"
#include "scene/camera.h"
#include "scene/light.h"
#include "scene/scene.h"

namespace bvhlab {
namespace {

glm::dmat4 matrix_argument(const py::handle& argument) {
    const DoubleArray rows = numbers(argument, "to_world", {4, 4}, "(4, 4)");
    glm::dmat4 matrix;
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column) matrix[column][row] = rows.at(row, column);
    return matrix;
}

Camera make_camera(const std::string& kind, const py::object& to_world, const py::object& window,
                   double clip_start, double lens_radius, double focus_distance) {
    if (kind != "perspective" && kind != "orthographic")
        throw py::value_error("unknown camera kind '" + kind +
                              "'; there are perspective and orthographic");
    const DoubleArray sides = numbers(window, "window", {4}, "(4,): left, right, bottom, top");
    const Camera camera{kind == "perspective" ? CameraKind::perspective : CameraKind::orthographic,
                        matrix_argument(to_world),
                        sides.at(0),
                        sides.at(1),
                        sides.at(2),
                        sides.at(3),
                        clip_start,
                        lens_radius,
                        focus_distance};
    check_camera(camera);
    return camera;
}

LightKind light_kind(const std::string& kind) {
    if (kind == "point") return LightKind::point;
    if (kind == "sun") return LightKind::sun;
    if (kind == "spot") return LightKind::spot;
    if (kind == "area") return LightKind::area;
    throw py::value_error("unknown light kind '" + kind + "'; there are point, sun, spot and area");
}

LightShape light_shape(const std::string& shape) {
    if (shape == "rectangle") return LightShape::rectangle;
    if (shape == "disk") return LightShape::disk;
    throw py::value_error("unknown light shape '" + shape + "'; there are rectangle and disk");
}

Light make_light(const std::string& kind, const py::object& to_world, const py::object& color,
                 double size_x, double size_y, const std::string& shape, double spot_angle,
                 double spot_blend) {
    const Light light{light_kind(kind),
                      matrix_argument(to_world),
                      color_argument(color, "color"),
                      size_x,
                      size_y,
                      light_shape(shape),
                      spot_angle,
                      spot_blend};
    check_light(light);
    return light;
}

World make_world(const py::object& color, const std::optional<std::int64_t>& texture,
                 const py::object& to_texture) {
    World world;
    world.color = color_argument(color, "color");
    if (texture) world.texture = count_argument(*texture, "texture", 0, no_texture - 1);
    if (to_texture.is_none()) return world;
    const DoubleArray rows = numbers(to_texture, "to_texture", {3, 3}, "(3, 3)");
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column)
            world.to_texture[column][row] = rows.at(row, column);
    return world;
}

Array<std::uint32_t> material_index_argument(const py::handle& argument) {
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    PyErr_Clear();
    if ((kind != 'i' && kind != 'u') || array.ndim() != 1)
        throw py::value_error("material_index must be integers of shape (T,)");
    using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
    const Indices wide = converted<Indices>(array);
    Array<std::uint32_t> indices(std::size_t(wide.size()));
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
        if (wide.data()[i] < 0 || wide.data()[i] > 0xFFFFFFFFLL)
            throw py::value_error("triangle " + std::to_string(i) + " has material " +
                                  std::to_string(wide.data()[i]) + ", which cannot exist");
        indices[std::size_t(i)] = std::uint32_t(wide.data()[i]);
    }
    return indices;
}

/// One vector for each corner of the triangles, from an array (T, 3, n); none for None.
template <class Vector>
Array<Vector> corner_argument(const py::object& argument, const char* name,
                              const char* shape_text) {
    if (argument.is_none()) return {};
    constexpr int width = Vector::length();
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    PyErr_Clear();
    if ((kind != 'f' && kind != 'i' && kind != 'u') || array.ndim() != 3 || array.shape(1) != 3 ||
        array.shape(2) != width)
        throw py::value_error(std::string(name) + " must be numbers of shape " + shape_text);
    const FloatArray floats = converted<FloatArray>(array);
    static_assert(sizeof(Vector) == width * sizeof(float));
    const auto* first = reinterpret_cast<const Vector*>(floats.data());
    return {first, first + 3 * floats.shape(0)};
}

std::shared_ptr<Scene> scene_from_python(const std::shared_ptr<Mesh>& mesh,
                                         const std::vector<PyMaterial>& materials,
                                         const py::object& material_index,
                                         const std::vector<Light>& lights, const World& world,
                                         const std::vector<std::shared_ptr<Texture>>& textures,
                                         const py::object& uvs, const py::object& normals) {
    SceneParts parts{mesh, {}, material_index_argument(material_index), lights, world};
    for (const PyMaterial& material : materials)
        parts.materials.push_back(with_lookups(material, parts.lookups));
    parts.textures.assign(textures.begin(), textures.end());
    parts.uvs = corner_argument<glm::vec2>(uvs, "uvs", "(T, 3, 2)");
    parts.normals = corner_argument<glm::vec3>(normals, "normals", "(T, 3, 3)");
    const py::gil_scoped_release release;
    return std::make_shared<Scene>(make_scene(std::move(parts)));
}

py::dict features_of(const Scene& scene) {
    const Features& features = scene.features;
    py::dict result;
    result["textures"] = features.textures;
    result["smooth"] = features.smooth;
    result["gloss"] = features.gloss;
    result["transmission"] = features.transmission;
    result["transparency"] = features.transparency;
    result["emitters"] = features.emitters;
    result["lamps"] = features.lamps;
    result["world"] = features.world;
    result["environment"] = features.environment;
    return result;
}

/// Bytes of the arrays that a scene holds beside its mesh, by part; 0 where it has no such part.
py::dict bytes_of(const Scene& scene) {
    const auto bytes = [](const auto& array) { return array.size() * sizeof(array[0]); };
    std::size_t texels = 0;
    for (const auto& texture : scene.textures)
        texels += bytes(texture->bytes) + bytes(texture->floats);
    py::dict result;
    result["materials"] = bytes(scene.materials) + bytes(scene.material_index);
    result["lights"] = bytes(scene.lights);
    result["lookups"] = bytes(scene.lookups);
    result["textures"] = texels;
    result["uvs"] = bytes(scene.uvs);
    result["normals"] = bytes(scene.normals);
    return result;
}

void bind_camera(py::module_& module) {
    py::class_<Camera>(module, "Camera", "A view that looks along its -Z with +Y up.")
        .def(py::init(&make_camera), py::arg("kind"), py::arg("to_world"), py::arg("window"),
             py::arg("clip_start") = 0.0, py::arg("lens_radius") = 0.0,
             py::arg("focus_distance") = 1.0,
             R"(kind 'perspective' or 'orthographic'; to_world (4, 4) without scale.

window is (left, right, bottom, top), at distance 1 or in world units; lens_radius (0: all is sharp)
and focus_distance along -Z in world units. Raises ValueError.)");
}

void bind_light(py::module_& module) {
    py::class_<Light>(module, "Light", "A lamp in Blender's units that shines along its -Z.")
        .def(py::init(&make_light), py::arg("kind"), py::arg("to_world"), py::arg("color"),
             py::arg("size_x") = 0.0, py::arg("size_y") = 0.0, py::arg("shape") = "rectangle",
             py::arg("spot_angle") = std::numbers::pi, py::arg("spot_blend") = 0.0,
             R"(kind 'point', 'sun', 'spot' or 'area'; color (3,) times power in W (sun: W/m2).

size_x is the radius (point, spot), angular diameter in radians (sun) or width (area). Raises
ValueError.)");
    py::class_<World>(module, "World", "The background.")
        .def(py::init(&make_world), py::arg("color") = py::make_tuple(0.0, 0.0, 0.0),
             py::arg("texture") = py::none(), py::arg("to_texture") = py::none(),
             R"(color (3,): radiance, or the factor of an equirectangular texture.

texture is an index into the scene's textures, or None; to_texture (3, 3) rotates world directions
into the picture's, whose +Z is up and whose centre lies at +X. Raises ValueError.)");
}

}  // namespace

void bind_scene(py::module_& module) {
    bind_camera(module);
    bind_light(module);
    bind_material(module);
    py::class_<Scene, std::shared_ptr<Scene>>(module, "Scene", "A mesh with materials and lights.")
        .def(py::init(&scene_from_python), py::arg("mesh"), py::arg("materials"),
             py::arg("material_index"), py::arg("lights") = std::vector<Light>(),
             py::arg("world") = World(), py::arg("textures") = std::vector<py::object>(),
             py::arg("uvs") = py::none(), py::arg("normals") = py::none(),
             R"(Lists of Material, Light and Texture, a World, and arrays by triangle.

material_index (T,) below the number of materials; uvs (T, 3, 2) and unit normals (T, 3, 3) by
corner, or None. Raises ValueError naming the first bad material, triangle, texture or light.)")
        .def_property_readonly(
            "mesh", [](const Scene& scene) { return std::const_pointer_cast<Mesh>(scene.mesh); })
        .def_property_readonly("features", &features_of,
                               "What the scene uses: dict of bool by name.")
        .def_property_readonly("bytes", &bytes_of,
                               "Bytes held beside the mesh: dict by part, 0 where there is none.");
}

}  // namespace bvhlab
