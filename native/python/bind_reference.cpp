// SPDX-License-Identifier: GPL-3.0-or-later
// brute_force, embree, EmbreeScene.
#include <pybind11/stl.h>

#include <stdexcept>

#include "python/convert.h"
#include "reference/brute_force.h"

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
