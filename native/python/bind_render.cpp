// SPDX-License-Identifier: GPL-3.0-or-later
// Picture, Renderer, render, PathRays, path_rays, camera_rays.
#include <unistd.h>

#include <cstdio>
#include <limits>
#include <optional>
#include <vector>

#include "opencl/renderer.h"
#include "python/arguments.h"
#include "python/device_calls.h"
#include "render/camera_rays.h"
#include "render/path_rays.h"
#include "render/renderer.h"
#include "scene/camera.h"
#include "scene/scene.h"

namespace bvhlab {
namespace {

// --- arguments -----------------------------------------------------------------------------------

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

/// A picture as numpy holds it.
struct PyPicture {
    py::object pixels;
    py::dict passes, rays, stage_seconds;
    std::uint32_t samples;
    double seconds, trace_seconds;
    std::string device = "cpu";
};

PyPicture to_python(Picture&& picture, const Raster& raster) {
    const auto image = [&](auto&& array, auto... channels) {
        return to_numpy(std::move(array)).attr("reshape")(raster.height, raster.width, channels...);
    };
    FilmPicture& film = picture.film;
    PyPicture result{image(film.pixels, 3),   {},   {}, {}, picture.samples, picture.seconds,
                     picture.trace_seconds(), "cpu"};
    if (!film.depth.empty()) {
        result.passes["normal"] = image(film.normal, 3);
        result.passes["depth"] = image(film.depth);
        result.passes["albedo"] = image(film.albedo, 3);
        result.passes["node_visits"] = image(film.node_visits);
        result.passes["triangle_tests"] = image(film.triangle_tests);
    }
    result.rays["primary"] = picture.rays.primary;
    result.rays["secondary"] = picture.rays.secondary;
    result.rays["last"] = picture.rays.last;
    result.rays["shadow"] = picture.rays.shadow;
    for (std::size_t i = 0; i < stage_names.size(); ++i)
        result.stage_seconds[stage_names[i]] = picture.stages[i];
    return result;
}

PathSettings path_settings(std::int64_t depth, std::int64_t shadow_rays) {
    return {count_argument(depth, "depth", 0, most_depth),
            count_argument(shadow_rays, "shadow_rays", 0, most_shadow_rays)};
}

/// A Renderer with what it refers to.
class PyRenderer {
    template <class Function>
    auto with_renderer(Function&& function) const {
        return device_renderer_ ? function(*device_renderer_) : function(*renderer_);
    }

public:
    PyRenderer(std::shared_ptr<PyBvh> bvh, std::shared_ptr<Scene> scene, const Camera& camera,
               std::int64_t width, std::int64_t height, std::int64_t seed, std::int64_t depth,
               std::int64_t shadow_rays, const py::object& reorder, bool passes, int threads,
               const std::string& device)
        : bvh_(std::move(bvh)),
          scene_(std::move(scene)),
          camera_(camera),
          raster_(raster_argument(width, height, seed)) {
        check_threads(threads);
        RenderOptions options;
        options.tracer = {path_settings(depth, shadow_rays), reorder_from_python(reorder), passes};
        options.threads = threads;
        check_memory(raster_, Film::bytes_per_pixel(passes), "pictures");
        const py::gil_scoped_release release;
        const View view{bvh_->bvh, *scene_, camera_, raster_};
        device_ = device_named(device);
        if (!device_) {
            renderer_.emplace(view, options);
            return;
        }
        const Token token;
        opencl::Commands commands(*device_, token);
        device_renderer_.emplace(device_, view, bvh_->copies.on(commands, bvh_->bvh), options,
                                 token);
    }

    /// Full id of the device that renders.
    std::string device() const { return device_ ? device_->info().id : "cpu"; }

    void render(std::int64_t samples, const std::shared_ptr<Token>& given_token) {
        const std::uint32_t count = count_argument(samples, "samples", 1, most_samples);
        const auto token = token_or_new(given_token);
        const py::gil_scoped_release release;
        with_renderer([&](auto& renderer) { renderer.render(count, *token); });
    }

    std::uint32_t samples() const {
        const py::gil_scoped_release release;
        return with_renderer([](const auto& renderer) { return renderer.samples(); });
    }

    PyPicture picture() const {
        Picture picture;
        {
            const py::gil_scoped_release release;
            picture = with_renderer([](const auto& renderer) { return renderer.picture(); });
        }
        PyPicture result = to_python(std::move(picture), raster_);
        result.device = device();
        return result;
    }

private:
    std::shared_ptr<PyBvh> bvh_;
    std::shared_ptr<Scene> scene_;
    Camera camera_;
    Raster raster_;
    std::shared_ptr<opencl::Device> device_;  ///< null: cpu
    mutable std::optional<Renderer> renderer_;
    mutable std::optional<opencl::Renderer> device_renderer_;
};

PyPicture render_call(const std::shared_ptr<PyBvh>& bvh, const std::shared_ptr<Scene>& scene,
                      const Camera& camera, std::int64_t width, std::int64_t height,
                      std::int64_t samples, std::int64_t seed, std::int64_t depth,
                      std::int64_t shadow_rays, const py::object& reorder, bool passes, int threads,
                      const std::shared_ptr<Token>& token, const std::string& device) {
    count_argument(samples, "samples", 1, most_samples);
    PyRenderer renderer(bvh, scene, camera, width, height, seed, depth, shadow_rays, reorder,
                        passes, threads, device);
    renderer.render(samples, token);
    return renderer.picture();
}

/// Rays as numpy holds them.
struct PyPathRays {
    py::tuple primary;
    py::list secondary, shadow;
};

py::tuple to_python(RayArrays&& rays) {
    return py::make_tuple(to_numpy(std::move(rays.origins)), to_numpy(std::move(rays.directions)));
}

PyPathRays path_rays_call(const PyBvh& bvh, const Scene& scene, const Camera& camera,
                          std::int64_t width, std::int64_t height, std::int64_t depth,
                          std::int64_t shadow_rays, std::int64_t seed, std::int64_t sample,
                          int threads, const std::shared_ptr<Token>& given_token) {
    const Raster raster = raster_argument(width, height, seed);
    const PathSettings settings = path_settings(depth, shadow_rays);
    const std::uint32_t index = count_argument(sample, "sample", 0, most_samples - 1);
    check_threads(threads);
    check_memory(raster, path_rays_bytes(settings), "the rays of paths");
    const auto token = token_or_new(given_token);
    PathRays rays;
    {
        const py::gil_scoped_release release;
        rays = path_rays({bvh.bvh, scene, camera, raster}, settings, index, threads, *token);
    }
    PyPathRays result;
    result.primary = to_python(std::move(rays.primary));
    for (RayArrays& bounce : rays.secondary) result.secondary.append(to_python(std::move(bounce)));
    for (ShadowRays& bounce : rays.shadow)
        result.shadow.append(py::make_tuple(to_numpy(std::move(bounce.rays.origins)),
                                            to_numpy(std::move(bounce.rays.directions)),
                                            to_numpy(std::move(bounce.t_max))));
    return result;
}

// --- classes -------------------------------------------------------------------------------------

void bind_picture(py::module_& module) {
    py::class_<PyPicture>(module, "Picture", "A rendered picture with what it took.")
        .def_readonly("pixels", &PyPicture::pixels, "(H, W, 3) float32, linear RGB radiance.")
        .def_readonly("passes", &PyPicture::passes,
                      "Of primary rays, float32; empty unless asked for: normal (H, W, 3), depth "
                      "(H, W) along the ray and infinite for a miss, albedo (H, W, 3), node_visits "
                      "(H, W), triangle_tests (H, W). Means over samples; depth is the first's.")
        .def_readonly(
            "rays", &PyPicture::rays,
            "Rays traced, by kind: primary, secondary, last (after the last bounce, which "
            "only look for light), shadow.")
        .def_readonly("samples", &PyPicture::samples, "Samples that every pixel has.")
        .def_readonly("device", &PyPicture::device, "Full id of the device that rendered.")
        .def_readonly("seconds", &PyPicture::seconds, "Wall-clock time of rendering.")
        .def_readonly("trace_seconds", &PyPicture::trace_seconds,
                      "Of which keys, sorting and traversal.")
        .def_readonly("stage_seconds", &PyPicture::stage_seconds,
                      "Seconds by stage: generate, key, sort, primary, secondary, last and shadow "
                      "(traversal of each), shade, compact, film.");
}

void bind_renderer(py::module_& module) {
    py::class_<PyRenderer>(module, "Renderer", "A picture that gets better the longer it runs.")
        .def(py::init<std::shared_ptr<PyBvh>, std::shared_ptr<Scene>, const Camera&, std::int64_t,
                      std::int64_t, std::int64_t, std::int64_t, std::int64_t, const py::object&,
                      bool, int, const std::string&>(),
             py::arg("bvh"), py::arg("scene"), py::arg("camera"), py::arg("width"),
             py::arg("height"), py::arg("seed") = 0, py::arg("depth") = 8,
             py::arg("shadow_rays") = 2, py::arg("reorder") = false, py::arg("passes") = false,
             py::arg("threads") = 0, py::arg("device") = "cpu",
             "Arguments as of core.render. Raises ValueError, and where the device fails "
             "RuntimeError and MemoryError.")
        .def("render", &PyRenderer::render, py::arg("samples"), py::arg("token") = nullptr,
             "Adds samples to every pixel; one by one or all at once give the same bits. Raises "
             "ValueError, and Cancelled after token.cancel(), keeping what was finished.")
        .def_property_readonly("samples", &PyRenderer::samples, "Samples that every pixel has.")
        .def_property_readonly("device", &PyRenderer::device, "Full id of the device.")
        .def("picture", &PyRenderer::picture,
             "The Picture so far; also while another thread renders. Where a render was cancelled "
             "the upper pixels may have more samples; a pixel without any is black.");
}

void bind_path_rays(py::module_& module) {
    py::class_<PyPathRays>(module, "PathRays", "The rays that a path tracer traces, none dead.")
        .def_readonly("primary", &PyPathRays::primary,
                      "(origins, directions), each (N, 3) float32; unit directions, no end.")
        .def_readonly("secondary", &PyPathRays::secondary,
                      "[(origins, directions)] by bounce, from 1 to depth.")
        .def_readonly("shadow", &PyPathRays::shadow,
                      "[(origins, directions, t_max)] by bounce, from 0 to depth, for any-hit "
                      "queries; t_max (N,) float32. Directions run to the light's point (t = 1).");
    module.def("path_rays", &path_rays_call, py::arg("bvh"), py::arg("scene"), py::arg("camera"),
               py::arg("width"), py::arg("height"), py::arg("depth") = 8,
               py::arg("shadow_rays") = 2, py::arg("seed") = 0, py::arg("sample") = 0,
               py::arg("threads") = 0, py::arg("token") = nullptr,
               "The rays that core.render traces for one sample of every pixel, as PathRays, in "
               "the order of the paths. The same for every tree and thread count. Raises "
               "ValueError, and Cancelled after token.cancel().");
}

}  // namespace

void bind_render(py::module_& module) {
    bind_picture(module);
    bind_renderer(module);
    bind_path_rays(module);
    module.def("camera_rays", &camera_rays_call, py::arg("camera"), py::arg("width"),
               py::arg("height"), py::arg("sample") = 0, py::arg("seed") = 0,
               py::arg("threads") = 0,
               "(origins, directions), (width * height, 3) float32, row by row from the top left. "
               "Sample 0 goes through pixel centres. Directions have unit length.");
    module.def("render", &render_call, py::arg("bvh"), py::arg("scene"), py::arg("camera"),
               py::arg("width"), py::arg("height"), py::arg("samples") = 1, py::arg("seed") = 0,
               py::arg("depth") = 8, py::arg("shadow_rays") = 2, py::arg("reorder") = false,
               py::arg("passes") = false, py::arg("threads") = 0, py::arg("token") = nullptr,
               py::arg("device") = "cpu",
               "Path traces a Picture. Paths go on `depth` times after the first hit (0: direct "
               "light) and take `shadow_rays` light samples at each hit. The same picture for "
               "every tree, reorder and thread count of one device; another's is the same but for "
               "the last bits of numbers. `device` is as of trace(). Raises ValueError, Cancelled "
               "after token.cancel(), and where the device fails RuntimeError and MemoryError.");
}

}  // namespace bvhlab
