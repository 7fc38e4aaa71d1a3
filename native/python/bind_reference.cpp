// SPDX-License-Identifier: GPL-3.0-or-later
// brute_force, crossing, exact_tie, embree, EmbreeScene.
#include <pybind11/stl.h>

#include <stdexcept>

#include "python/convert.h"
#include "reference/brute_force.h"
#include "reference/crossings.h"

#ifdef BVHLAB_WITH_EMBREE
#include "reference/embree.h"
#endif

namespace bvhlab {
namespace {

PyHits judge(const Mesh& mesh, const py::object& origins, const py::object& directions,
             const py::object& t_min, const py::object& t_max, bool any_hit, int threads,
             const std::shared_ptr<Token>& given_token) {
    check_threads(threads);
    const RayArguments rays(origins, directions, t_min, t_max);
    const auto token = token_or_new(given_token);
    HitsOf<double> hits;
    {
        const py::gil_scoped_release release;
        hits = brute_force(mesh, rays.batch(), any_hit, threads, *token);
    }
    return to_python(std::move(hits), any_hit, false);
}

/// What core.crossing returns (class `Crossings` in Python).
struct PyCrossings {
    py::object meets, t, u, v, margin, condition;
};

using Indices = py::array_t<std::uint32_t, py::array::c_style>;

/// One triangle index a ray, as uint32. Throws ValueError naming the argument, and the first ray
/// whose triangle does not exist.
Indices triangle_per_ray(const py::handle& argument, const char* name, const Mesh& mesh,
                         std::size_t rays) {
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    if (kind != 'i' && kind != 'u')
        throw py::value_error(std::string(name) + " must be an array of integers");
    if (array.ndim() != 1 || std::size_t(array.shape(0)) != rays)
        throw py::value_error(std::string(name) + " must have shape (" + std::to_string(rays) +
                              ",): one triangle a ray");
    using Wide = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
    const auto wide = converted<Wide>(array);
    Indices indices(wide.size());
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
        const std::int64_t index = wide.data()[i];
        if (index < 0 || std::uint64_t(index) >= mesh.size())
            throw py::value_error("ray " + std::to_string(i) + ": " + name +
                                  (index == no_triangle
                                       ? std::string(" is that of a miss")
                                       : " is " + std::to_string(index) + ", but there are " +
                                             std::to_string(mesh.size()) + " triangles"));
        indices.mutable_data()[i] = std::uint32_t(index);
    }
    return indices;
}

std::span<const std::uint32_t> as_span(const Indices& indices) {
    return {indices.data(), std::size_t(indices.size())};
}

PyCrossings crossing_of(const Mesh& mesh, const py::object& origins, const py::object& directions,
                        const py::object& triangle, int threads,
                        const std::shared_ptr<Token>& given_token) {
    check_threads(threads);
    const RayArguments rays(origins, directions, py::float_(0.0), py::float_(0.0));
    const Indices indices = triangle_per_ray(triangle, "triangle", mesh, rays.batch().size());
    const auto token = token_or_new(given_token);
    Crossings found;
    {
        const py::gil_scoped_release release;
        found = crossings(mesh, rays.batch(), as_span(indices), threads, *token);
    }
    return {to_numpy(std::move(found.meets)).view("bool"),
            to_numpy(std::move(found.t)),
            to_numpy(std::move(found.u)),
            to_numpy(std::move(found.v)),
            to_numpy(std::move(found.margin)),
            to_numpy(std::move(found.condition))};
}

py::object exact_tie_of(const Mesh& mesh, const py::object& origins, const py::object& directions,
                        const py::object& first, const py::object& second, int threads,
                        const std::shared_ptr<Token>& given_token) {
    check_threads(threads);
    const RayArguments rays(origins, directions, py::float_(0.0), py::float_(0.0));
    const Indices one = triangle_per_ray(first, "first", mesh, rays.batch().size());
    const Indices two = triangle_per_ray(second, "second", mesh, rays.batch().size());
    const auto token = token_or_new(given_token);
    Array<std::uint8_t> ties;
    {
        const py::gil_scoped_release release;
        ties = exact_ties(mesh, rays.batch(), as_span(one), as_span(two), threads, *token);
    }
    return to_numpy(std::move(ties)).view("bool");
}

#ifndef BVHLAB_WITH_EMBREE

/// Stands for Embree in a build without it: every use says so.
struct EmbreeStatus {
    bool available = false;
    std::string version;
    std::string reason = "this build of BVH Lab was built without Embree";
};
EmbreeStatus embree_status() {
    return {};
}

enum class EmbreeQuality { low, medium, high };

struct EmbreeScene {
    EmbreeScene(const Mesh&, EmbreeQuality, bool, int) {
        throw std::runtime_error(embree_status().reason);
    }
    double build_seconds() const { return 0.0; }
    Hits trace(const RayBatch&, bool, int, Token&) const { return {}; }
};

#endif

py::dict embree() {
    EmbreeStatus status;
    {
        const py::gil_scoped_release release;
        status = embree_status();
    }
    py::dict result;
    result["available"] = status.available;
    result["version"] = status.version;
    result["reason"] = status.reason;
    return result;
}

EmbreeQuality quality_from_text(const std::string& text) {
    if (text == "low") return EmbreeQuality::low;
    if (text == "medium") return EmbreeQuality::medium;
    if (text == "high") return EmbreeQuality::high;
    throw py::value_error("unknown Embree quality '" + text + "'; there are low, medium, high");
}

std::unique_ptr<EmbreeScene> make_scene(const Mesh& mesh, const std::string& quality_text,
                                        bool robust, int threads) {
    const EmbreeQuality quality = quality_from_text(quality_text);
    check_threads(threads);
    const py::gil_scoped_release release;
    return std::make_unique<EmbreeScene>(mesh, quality, robust, threads);
}

PyHits trace_scene(const EmbreeScene& scene, const py::object& origins,
                   const py::object& directions, const py::object& t_min, const py::object& t_max,
                   bool any_hit, int threads, const std::shared_ptr<Token>& given_token) {
    check_threads(threads);
    const RayArguments rays(origins, directions, t_min, t_max);
    const auto token = token_or_new(given_token);
    Hits hits;
    {
        const py::gil_scoped_release release;
        hits = scene.trace(rays.batch(), any_hit, threads, *token);
    }
    return to_python(std::move(hits), any_hit, false);
}

}  // namespace

void bind_reference(py::module_& module) {
    using py::arg;
    constexpr float infinity = std::numeric_limits<float>::infinity();

    module.def("brute_force", &judge, arg("mesh"), arg("origins"), arg("directions"),
               arg("t_min") = 0.0F, arg("t_max") = infinity, arg("any_hit") = false,
               arg("threads") = 0, arg("token") = nullptr,
               R"(Test every ray against every triangle; the judge of every other way to trace.

Which triangle is hit is decided without any rounding of the given float32 numbers: edges and corners
inside, both sides hit, t_min <= t <= t_max, equal t to the lower index. t, u and v are float64, within 4
units in the last place. Arguments, fields and errors otherwise as for `trace`.)");

    py::class_<PyCrossings>(module, "Crossings",
                            "Where lines cross given triangles; see `crossing`.")
        .def_readonly("meets", &PyCrossings::meets)
        .def_readonly("t", &PyCrossings::t)
        .def_readonly("u", &PyCrossings::u)
        .def_readonly("v", &PyCrossings::v)
        .def_readonly("margin", &PyCrossings::margin)
        .def_readonly("condition", &PyCrossings::condition);

    module.def(
        "crossing", &crossing_of, arg("mesh"), arg("origins"), arg("directions"), arg("triangle"),
        arg("threads") = 0, arg("token") = nullptr,
        R"(Where the line of each ray crosses the triangle given for it: what answers are measured by.

origins and directions (N, 3) float32, triangle (N,) integers below the number of triangles. Fields of the
result, each (N,):
meets      bool: the line meets the closed triangle, decided without any rounding
t, u, v    float64: crossing of the line and the triangle's plane, within 4 units in the last place
margin     float64: least of 1 - u - v, u and v, so how far inside; below 0 outside
condition  float64: by how much rounding is magnified in t = n / d, n = det(a - o, b - o, c - o) and d the
           sum of det(direction, p - o, q - o) over the edges: sum of |products| of n over |n| plus the same
           for d; infinite where n is 0. Arithmetic with relative error e gets t within a small multiple of
           condition * e. The given numbers count as exact.
Where direction . normal is 0 there is no crossing: t, u, v NaN, margin -inf, condition inf.
Raises ValueError naming the first bad ray or triangle.)");

    module.def(
        "exact_tie", &exact_tie_of, arg("mesh"), arg("origins"), arg("directions"), arg("first"),
        arg("second"), arg("threads") = 0, arg("token") = nullptr,
        R"((N,) bool: whether the line of each ray meets both of its triangles, and at the same t.

Decided without any rounding; first and second as `triangle` of `crossing`.)");

    module.def("embree", &embree,
               R"(Whether Embree can be used: dict of available, version and reason.

Opened at the first call (Embree 4, else 3) and checked: its version and two known rays.)");

    py::class_<EmbreeScene>(module, "EmbreeScene", "A mesh in Embree, the outside reference.")
        .def(py::init(&make_scene), arg("mesh"), arg("quality") = "medium", arg("robust") = true,
             arg("threads") = 0,
             R"(Build with quality "low" (Morton), "medium" (binned SAH) or "high" (spatial splits).

robust makes Embree's tests watertight, as ours are. Raises RuntimeError with the reason where Embree is
not available or fails.)")
        .def_property_readonly("build_seconds", &EmbreeScene::build_seconds,
                               "Wall-clock seconds of Embree's build, without copying the mesh.")
        .def("trace", &trace_scene, arg("origins"), arg("directions"), arg("t_min") = 0.0F,
             arg("t_max") = infinity, arg("any_hit") = false, arg("threads") = 0,
             arg("token") = nullptr, "Trace rays one by one; as `trace` of this module.");
}

}  // namespace bvhlab
