// SPDX-License-Identifier: GPL-3.0-or-later
// Texture, Lookup, Component, Material.
#include <pybind11/stl.h>

#include <limits>
#include <string>
#include <utility>

#include "python/arguments.h"
#include "python/material_arguments.h"
#include "scene/texture.h"

#ifdef BVHLAB_WITH_OIIO
#include "image/read.h"
#endif

namespace bvhlab {
namespace {

// --- names ---------------------------------------------------------------------------------------

template <class Value, std::size_t count>
Value named(const std::string& name, const char* what,
            const std::pair<const char*, Value> (&names)[count]) {
    std::string known;
    for (const auto& [text, value] : names) {
        if (name == text) return value;
        known += std::string(known.empty() ? "" : ", ") + text;
    }
    throw py::value_error(std::string("unknown ") + what + " '" + name + "'; there are " + known);
}

Wrap wrap_named(const std::string& name) {
    static constexpr std::pair<const char*, Wrap> names[] = {{"repeat", Wrap::repeat},
                                                             {"extend", Wrap::extend},
                                                             {"clip", Wrap::clip},
                                                             {"mirror", Wrap::mirror}};
    return named(name, "wrap", names);
}

Channel channel_named(const std::string& name) {
    static constexpr std::pair<const char*, Channel> names[] = {
        {"rgb", Channel::rgb},   {"red", Channel::red},     {"green", Channel::green},
        {"blue", Channel::blue}, {"alpha", Channel::alpha}, {"luminance", Channel::luminance}};
    return named(name, "channel", names);
}

Model model_named(const std::string& name) {
    static constexpr std::pair<const char*, Model> names[] = {
        {"principled", Model::principled},  {"diffuse", Model::diffuse},
        {"glossy", Model::glossy},          {"glass", Model::glass},
        {"refraction", Model::refraction},  {"translucent", Model::translucent},
        {"transparent", Model::transparent}};
    return named(name, "model", names);
}

// --- textures ------------------------------------------------------------------------------------

template <class Value>
Array<Value> values_of(const py::array& pixels) {
    using Values = py::array_t<Value, py::array::c_style | py::array::forcecast>;
    const Values values = converted<Values>(pixels);
    return {values.data(), values.data() + values.size()};
}

/// uint8 stays bytes, all other numbers become float.
std::shared_ptr<Texture> texture_from_pixels(const py::object& pixels, bool srgb,
                                             const std::string& wrap, bool closest) {
    const py::array array = py::array::ensure(pixels);
    const char kind = array ? array.dtype().kind() : '?';
    PyErr_Clear();
    if ((kind != 'f' && kind != 'u') || (kind == 'u' && array.itemsize() != 1))
        throw py::value_error("pixels must be an array of uint8 or float32");
    constexpr py::ssize_t most = most_texels_a_side;
    if (array.ndim() < 2 || array.ndim() > 3 || array.shape(0) > most || array.shape(1) > most ||
        (array.ndim() == 3 && array.shape(2) > 4))
        throw py::value_error(
            "pixels must have shape (H, W) or (H, W, C) with C 1, 3 or 4, and sides up to 65535");
    auto texture = std::make_shared<Texture>();
    texture->height = std::uint32_t(array.shape(0));
    texture->width = std::uint32_t(array.shape(1));
    texture->channels = array.ndim() == 3 ? std::uint32_t(array.shape(2)) : 1;
    if (kind == 'u')
        texture->bytes = values_of<std::uint8_t>(array);
    else
        texture->floats = values_of<float>(array);
    texture->srgb = srgb;
    texture->wrap = wrap_named(wrap);
    texture->closest = closest;
    check_texture(*texture);
    return texture;
}

#ifdef BVHLAB_WITH_OIIO

std::shared_ptr<Texture> texture_from_file(const py::object& path, bool srgb,
                                           const std::string& wrap, bool closest) {
    const auto file = py::module_::import("os").attr("fspath")(path).cast<std::string>();
    const Wrap wrapped = wrap_named(wrap);
    const py::gil_scoped_release release;
    auto texture = std::make_shared<Texture>(read_texture(file));
    texture->srgb = srgb;
    texture->wrap = wrapped;
    texture->closest = closest;
    return texture;
}

#else

std::shared_ptr<Texture> texture_from_file(const py::object&, bool, const std::string&, bool) {
    throw std::runtime_error("this build of BVH Lab has no OpenImageIO: it reads no textures");
}

#endif

py::array_t<float> looked_up(const Texture& texture, const py::object& uv) {
    const FloatArray places = float_rows(uv, "uv", 2);
    const py::ssize_t count = places.shape(0);
    py::array_t<float> result({count, py::ssize_t(4)});
    for (py::ssize_t i = 0; i < count; ++i) {
        const glm::vec4 value = look_up(texture, {places.at(i, 0), places.at(i, 1)});
        for (int channel = 0; channel < 4; ++channel)
            result.mutable_at(i, channel) = value[channel];
    }
    return result;
}

py::array_t<float> average_of(const Texture& texture) {
    const glm::vec4 mean = average(texture);
    return py::array_t<float>(4, &mean[0]);
}

// --- materials -----------------------------------------------------------------------------------

/// A number for all three channels, or (3,).
glm::vec3 factor_argument(const py::object& argument, const char* name) {
    const py::array array = py::array::ensure(argument);
    PyErr_Clear();
    if (array && array.ndim() == 0)
        return glm::vec3(float(numbers(argument, name, {}, "() or (3,)").data()[0]));
    return color_argument(argument, name);
}

Lookup make_lookup(std::int64_t texture, const std::string& channel, const py::object& scale,
                   const py::object& offset, const py::object& mapping) {
    Lookup lookup;
    lookup.texture = count_argument(texture, "texture", 0, no_lookup - 1);
    lookup.channel = channel_named(channel);
    lookup.scale = factor_argument(scale, "scale");
    lookup.offset = factor_argument(offset, "offset");
    const DoubleArray rows = numbers(mapping, "mapping", {2, 3}, "(2, 3)");
    for (int row = 0; row < 2; ++row)
        for (int column = 0; column < 3; ++column)
            lookup.mapping[column][row] = float(rows.at(row, column));
    check_lookup(lookup);
    return lookup;
}

/// A number, or a Lookup, which `lookup` receives.
NumberInput number_input(const py::object& argument, const char* name,
                         std::optional<Lookup>& lookup) {
    NumberInput input{0.0F};
    if (py::isinstance<Lookup>(argument)) {
        lookup = argument.cast<Lookup>();
        return input;
    }
    input.value = float(numbers(argument, name, {}, "(), or a Lookup").data()[0]);
    return input;
}

/// A colour (3,), or a Lookup, which `lookup` receives.
glm::vec3 color_input(const py::object& argument, const char* name, std::optional<Lookup>& lookup) {
    if (!py::isinstance<Lookup>(argument)) {
        const DoubleArray color = numbers(argument, name, {3}, "(3,), or a Lookup");
        return {float(color.at(0)), float(color.at(1)), float(color.at(2))};
    }
    lookup = argument.cast<Lookup>();
    return glm::vec3(0.0F);
}

PyComponent make_component(const std::string& model, const py::object& weight,
                           const py::object& color, const py::object& roughness,
                           const py::object& metallic, const py::object& transmission, float ior,
                           float specular) {
    PyComponent made;
    Component& component = made.component;
    component.model = model_named(model);
    component.weight = number_input(weight, "weight", made.weight);
    component.color.value = color_input(color, "color", made.color);
    component.roughness = number_input(roughness, "roughness", made.roughness);
    component.metallic = number_input(metallic, "metallic", made.metallic);
    component.transmission = number_input(transmission, "transmission", made.transmission);
    component.ior = ior;
    component.specular = specular;
    check_component(component);
    return made;
}

PyMaterial make_material(const std::vector<PyComponent>& components, const py::object& emission) {
    PyMaterial material{components, glm::vec3(0.0F), std::nullopt};
    material.emission = color_input(emission, "emission", material.emission_lookup);
    check_emission(material.emission);
    return material;
}

std::uint32_t appended(const std::optional<Lookup>& lookup, std::vector<Lookup>& lookups) {
    if (!lookup) return no_lookup;
    lookups.push_back(*lookup);
    return std::uint32_t(lookups.size() - 1);
}

}  // namespace

Material with_lookups(const PyMaterial& material, std::vector<Lookup>& lookups) {
    Material result{{}, {material.emission, appended(material.emission_lookup, lookups)}};
    for (const PyComponent& given : material.components) {
        Component component = given.component;
        component.weight.lookup = appended(given.weight, lookups);
        component.color.lookup = appended(given.color, lookups);
        component.roughness.lookup = appended(given.roughness, lookups);
        component.metallic.lookup = appended(given.metallic, lookups);
        component.transmission.lookup = appended(given.transmission, lookups);
        result.components.push_back(component);
    }
    return result;
}

namespace {

void bind_texture(py::module_& module) {
    py::class_<Texture, std::shared_ptr<Texture>>(module, "Texture", "A picture to look up.")
        .def(py::init(&texture_from_pixels), py::arg("pixels"), py::arg("srgb") = false,
             py::arg("wrap") = "repeat", py::arg("closest") = false,
             R"(pixels (H, W) or (H, W, 1 | 3 | 4), uint8 or float32, top row first.

srgb: colours are encoded with the sRGB curve. wrap 'repeat', 'extend', 'clip' or 'mirror'.
closest: no interpolation. Raises ValueError.)")
        .def_static("read", &texture_from_file, py::arg("path"), py::arg("srgb") = false,
                    py::arg("wrap") = "repeat", py::arg("closest") = false,
                    R"(A picture file; RuntimeError names the file and what is wrong with it.)")
        .def("look_up", &looked_up, py::arg("uv"),
             "(N, 4) float32 linear RGBA at (N, 2) coordinates; v = 0 is the lower edge.")
        .def_readonly("width", &Texture::width)
        .def_readonly("height", &Texture::height)
        .def_readonly("channels", &Texture::channels)
        .def_property_readonly("average", &average_of, "(4,) float32: mean linear RGBA.");
    py::class_<Lookup>(module, "Lookup", "A value that a texture varies over a surface.")
        .def(py::init(&make_lookup), py::arg("texture"), py::arg("channel") = "rgb",
             py::arg("scale") = 1.0, py::arg("offset") = 0.0,
             py::arg("mapping") =
                 py::make_tuple(py::make_tuple(1.0, 0.0, 0.0), py::make_tuple(0.0, 1.0, 0.0)),
             R"(offset + scale * texel(mapping @ (u, v, 1)).

texture is an index into the scene's; channel 'rgb', 'red', 'green', 'blue', 'alpha' or 'luminance';
scale and offset a number or (3,); mapping (2, 3). Raises ValueError.)");
}

}  // namespace

void bind_material(py::module_& module) {
    bind_texture(module);
    py::class_<PyComponent>(module, "Component", "One part of a material.")
        .def(py::init(&make_component), py::arg("model") = "diffuse", py::arg("weight") = 1.0,
             py::arg("color") = py::make_tuple(0.8, 0.8, 0.8), py::arg("roughness") = 0.5,
             py::arg("metallic") = 0.0, py::arg("transmission") = 0.0, py::arg("ior") = 1.45,
             py::arg("specular") = 1.0,
             R"(model 'principled', 'diffuse', 'glossy', 'glass', 'refraction', 'translucent' or
'transparent'; all but ior (1 to 10) and specular (0 to 2: factor of the coat's normal reflectance)
may be a Lookup; weight, roughness, metallic and transmission 0 to 1, color (3,) 0 to 1. Raises
ValueError.)");
    py::class_<PyMaterial>(module, "Material", "What a surface does with light.")
        .def(py::init(&make_material), py::arg("components"),
             py::arg("emission") = py::make_tuple(0.0, 0.0, 0.0),
             R"(components: a list of up to 4, which add up; none is black.

emission: radiance (3,) in W/(m2 sr), or a Lookup. Raises ValueError.)");
}

}  // namespace bvhlab
