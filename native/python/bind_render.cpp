// SPDX-License-Identifier: GPL-3.0-or-later
// Camera, Light, Scene, camera_rays, shadow_rays, diffuse_rays, render.
#include <pybind11/stl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "python/convert.h"
#include "render/camera_rays.h"
#include "render/direct_light.h"
#include "render/secondary.h"
#include "scene/camera.h"
#include "scene/light.h"
#include "scene/scene.h"

namespace bvhlab {
namespace {

// --- arguments -----------------------------------------------------------------------------------

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Numbers of a given shape as float64. Throws ValueError naming the argument.
DoubleArray numbers(const py::handle& argument, const char* name,
                    const std::vector<py::ssize_t>& shape, const char* shape_text) {
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    const bool fits =
        (kind == 'f' || kind == 'i' || kind == 'u') &&
        std::vector<py::ssize_t>(array.shape(), array.shape() + array.ndim()) == shape;
    PyErr_Clear();
    if (!fits) throw py::value_error(std::string(name) + " must be numbers of shape " + shape_text);
    return DoubleArray::ensure(array);
}

glm::dmat4 matrix_argument(const py::handle& argument) {
    const DoubleArray rows = numbers(argument, "to_world", {4, 4}, "(4, 4)");
    glm::dmat4 matrix;
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column) matrix[column][row] = rows.at(row, column);
    return matrix;
}

glm::vec3 color_argument(const py::handle& argument, const char* name) {
    const DoubleArray color = numbers(argument, name, {3}, "(3,)");
    return {float(color.at(0)), float(color.at(1)), float(color.at(2))};
}

std::uint32_t count_argument(std::int64_t value, const char* name, std::int64_t least,
                             std::int64_t most) {
    if (value < least || value > most)
        throw py::value_error(std::string(name) + " must be " + std::to_string(least) + " to " +
                              std::to_string(most) + ", not " + std::to_string(value));
    return std::uint32_t(value);
}

/// Throws ValueError where arrays of this many bytes a pixel would take more than half the
/// machine's memory.
void check_memory(const Raster& raster, double bytes_per_pixel, const char* what) {
    constexpr double gibibyte = 1024.0 * 1024.0 * 1024.0;
    const double needed = double(raster.width) * double(raster.height) * bytes_per_pixel;
    const double memory = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGESIZE));
    if (needed <= 0.5 * memory) return;
    char text[200];
    std::snprintf(text, sizeof text,
                  "%s of %u x %u pixels take %.1f GiB, more than half of this machine's %.1f GiB; "
                  "choose a smaller picture",
                  what, raster.width, raster.height, needed / gibibyte, memory / gibibyte);
    throw py::value_error(text);
}

Raster raster_argument(std::int64_t width, std::int64_t height, std::int64_t seed) {
    constexpr std::int64_t last_seed = std::numeric_limits<std::uint32_t>::max();
    return {count_argument(width, "width", 1, largest_side),
            count_argument(height, "height", 1, largest_side),
            count_argument(seed, "seed", 0, last_seed)};
}

// --- scene ---------------------------------------------------------------------------------------

Camera make_camera(const std::string& kind, const py::object& to_world, const py::object& window,
                   double clip_start) {
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
                        clip_start};
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

Array<std::uint32_t> material_index_argument(const py::handle& argument) {
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    PyErr_Clear();
    if ((kind != 'i' && kind != 'u') || array.ndim() != 1)
        throw py::value_error("material_index must be integers of shape (T,)");
    using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
    const Indices wide = Indices::ensure(array);
    Array<std::uint32_t> indices(std::size_t(wide.size()));
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
        if (wide.data()[i] < 0 || wide.data()[i] > 0xFFFFFFFFLL)
            throw py::value_error("triangle " + std::to_string(i) + " has material " +
                                  std::to_string(wide.data()[i]) + ", which cannot exist");
        indices[std::size_t(i)] = std::uint32_t(wide.data()[i]);
    }
    return indices;
}

std::shared_ptr<Scene> scene_from_python(const std::shared_ptr<Mesh>& mesh,
                                         const py::object& base_color, const py::object& emission,
                                         const py::object& material_index,
                                         const std::vector<Light>& lights,
                                         const py::object& world) {
    const FloatArray colors = float_rows(base_color, "base_color", 3);
    const FloatArray emissions = float_rows(emission, "emission", 3, colors.shape(0));
    std::vector<Material> materials;
    for (std::size_t i = 0; i < std::size_t(colors.shape(0)); ++i)
        materials.push_back({as_vectors(colors)[i], as_vectors(emissions)[i]});
    return std::make_shared<Scene>(make_scene(mesh, std::move(materials),
                                              material_index_argument(material_index), lights,
                                              color_argument(world, "world")));
}

// --- calls ---------------------------------------------------------------------------------------

py::tuple camera_rays_call(const Camera& camera, std::int64_t width, std::int64_t height,
                           std::int64_t sample, std::int64_t seed, int threads) {
    const Raster raster = raster_argument(width, height, seed);
    const std::uint32_t index =
        count_argument(sample, "sample", 0, std::numeric_limits<std::uint32_t>::max());
    check_threads(threads);
    check_memory(raster, 2.0 * sizeof(glm::vec3), "camera rays");
    RayArrays rays;
    {
        const py::gil_scoped_release release;
        rays = camera_rays(camera, raster, index, threads, Token());
    }
    return py::make_tuple(to_numpy(std::move(rays.origins)), to_numpy(std::move(rays.directions)));
}

/// Primary rays with what they hit; keeps the numpy arrays alive.
struct PrimaryArguments {
    using Triangles = py::array_t<std::uint32_t, py::array::c_style | py::array::forcecast>;
    RayArguments rays;
    FloatArray u, v;
    Triangles triangle;
    std::uint32_t seed;

    PrimaryArguments(const Scene& scene, const py::object& origins, const py::object& directions,
                     const PyHits& hit, std::int64_t given_seed)
        : rays(origins, directions, py::float_(0.0), py::float_(0.0)) {
        if (hit.triangle.is_none())
            throw py::value_error("hit must come from a closest-hit query, not from any_hit=True");
        u = FloatArray::ensure(hit.u);
        v = FloatArray::ensure(hit.v);
        triangle = Triangles::ensure(hit.triangle);
        const std::size_t count = rays.batch().size();
        if (std::size_t(triangle.size()) != count)
            throw py::value_error("hit has " + std::to_string(triangle.size()) + " answers for " +
                                  std::to_string(count) + " rays");
        for (std::size_t i = 0; i < count; ++i) {
            const std::uint32_t index = triangle.data()[i];
            if (index != no_triangle && index >= scene.mesh->size())
                throw py::value_error("ray " + std::to_string(i) + " hit triangle " +
                                      std::to_string(index) + ", but the scene has only " +
                                      std::to_string(scene.mesh->size()));
        }
        seed = count_argument(given_seed, "seed", 0, std::numeric_limits<std::uint32_t>::max());
    }

    PrimaryHits hits() const {
        const std::size_t count = std::size_t(triangle.size());
        return {rays.batch().directions,
                {u.data(), count},
                {v.data(), count},
                {triangle.data(), count}};
    }
};

py::tuple shadow_rays_call(const Scene& scene, const py::object& origins,
                           const py::object& directions, const PyHits& hit, std::int64_t seed,
                           int threads) {
    check_threads(threads);
    const PrimaryArguments primary(scene, origins, directions, hit, seed);
    const PrimaryHits hits = primary.hits();
    ShadowRays shadow;
    {
        const py::gil_scoped_release release;
        shadow = shadow_rays(scene, hits, primary.seed, threads, Token());
    }
    return py::make_tuple(to_numpy(std::move(shadow.rays.origins)),
                          to_numpy(std::move(shadow.rays.directions)),
                          to_numpy(std::move(shadow.t_max)));
}

py::tuple diffuse_rays_call(const Scene& scene, const py::object& origins,
                            const py::object& directions, const PyHits& hit, std::int64_t seed,
                            int threads) {
    check_threads(threads);
    const PrimaryArguments primary(scene, origins, directions, hit, seed);
    const PrimaryHits hits = primary.hits();
    RayArrays rays;
    {
        const py::gil_scoped_release release;
        rays = diffuse_rays(scene, hits, primary.seed, threads, Token());
    }
    return py::make_tuple(to_numpy(std::move(rays.origins)), to_numpy(std::move(rays.directions)));
}

/// A picture as numpy holds it.
struct PyPicture {
    py::object pixels;
    std::uint64_t rays;
    double seconds, trace_seconds;
};

PyPicture render_call(const PyBvh& bvh, const Scene& scene, const Camera& camera,
                      std::int64_t width, std::int64_t height, std::int64_t samples,
                      std::int64_t seed, int threads, const std::shared_ptr<Token>& given_token) {
    const RenderOptions options{raster_argument(width, height, seed),
                                count_argument(samples, "samples", 1, most_samples), threads};
    check_threads(threads);
    check_memory(options.raster, sizeof(glm::vec3), "pictures");
    const auto token = token_or_new(given_token);
    Picture picture;
    {
        const py::gil_scoped_release release;
        picture = render(bvh.bvh, scene, camera, options, *token);
    }
    return {to_numpy(std::move(picture.pixels)).attr("reshape")(height, width, 3), picture.rays,
            picture.seconds, picture.trace_seconds};
}

// --- classes -------------------------------------------------------------------------------------

void bind_scene(py::module_& module) {
    py::class_<Camera>(module, "Camera", "A view that looks along its -Z with +Y up.")
        .def(py::init(&make_camera), py::arg("kind"), py::arg("to_world"), py::arg("window"),
             py::arg("clip_start") = 0.0,
             "kind 'perspective' or 'orthographic'; to_world (4, 4) without scale; window (left, "
             "right, bottom, top) at distance 1 or in world units. Raises ValueError.");
    py::class_<Light>(module, "Light", "A lamp in Blender's units that shines along its -Z.")
        .def(py::init(&make_light), py::arg("kind"), py::arg("to_world"), py::arg("color"),
             py::arg("size_x") = 0.0, py::arg("size_y") = 0.0, py::arg("shape") = "rectangle",
             py::arg("spot_angle") = std::numbers::pi, py::arg("spot_blend") = 0.0,
             "kind 'point', 'sun', 'spot' or 'area'; color (3,) times power in W (sun: W/m2). "
             "size_x "
             "is the radius (point, spot), angular diameter in radians (sun) or width (area). "
             "Raises ValueError.");
    py::class_<Scene, std::shared_ptr<Scene>>(module, "Scene", "A mesh with materials and lights.")
        .def(py::init(&scene_from_python), py::arg("mesh"), py::arg("base_color"),
             py::arg("emission"), py::arg("material_index"), py::arg("lights"), py::arg("world"),
             "base_color and emission (M, 3), material_index (T,) below M, a list of lights, world "
             "(3,). Raises ValueError naming the first bad material, triangle or light.")
        .def_property_readonly(
            "mesh", [](const Scene& scene) { return std::const_pointer_cast<Mesh>(scene.mesh); });
}

void bind_picture(py::module_& module) {
    py::class_<PyPicture>(module, "Picture", "What core.render returns.")
        .def_readonly("pixels", &PyPicture::pixels, "(H, W, 3) float32, linear RGB radiance.")
        .def_readonly("rays", &PyPicture::rays, "Rays traced: primary, shadow and world.")
        .def_readonly("seconds", &PyPicture::seconds, "Wall-clock time of all of it.")
        .def_readonly("trace_seconds", &PyPicture::trace_seconds, "Of which traversal.");
}

}  // namespace

void bind_render(py::module_& module) {
    bind_scene(module);
    bind_picture(module);
    module.def("camera_rays", &camera_rays_call, py::arg("camera"), py::arg("width"),
               py::arg("height"), py::arg("sample") = 0, py::arg("seed") = 0,
               py::arg("threads") = 0,
               "(origins, directions), (width * height, 3) float32, row by row from the top left. "
               "Sample 0 goes through pixel centres. Directions have unit length.");
    module.def(
        "shadow_rays", &shadow_rays_call, py::arg("scene"), py::arg("origins"),
        py::arg("directions"), py::arg("hit"), py::arg("seed") = 0, py::arg("threads") = 0,
        "(origins, directions, t_max): one ray for each hit towards a light chosen by power, or "
        "into the world where there is no light. Directions run to the light's point (t = 1).");
    module.def("diffuse_rays", &diffuse_rays_call, py::arg("scene"), py::arg("origins"),
               py::arg("directions"), py::arg("hit"), py::arg("seed") = 0, py::arg("threads") = 0,
               "(origins, directions): one cosine-distributed ray for each hit, of unit length.");
    module.def("render", &render_call, py::arg("bvh"), py::arg("scene"), py::arg("camera"),
               py::arg("width"), py::arg("height"), py::arg("samples") = 1, py::arg("seed") = 0,
               py::arg("threads") = 0, py::arg("token") = nullptr,
               "Direct light with shadow rays; the same picture for every tree and thread count. "
               "Raises ValueError, and Cancelled after token.cancel().");
}

}  // namespace bvhlab
