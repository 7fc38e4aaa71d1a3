// SPDX-License-Identifier: GPL-3.0-or-later
// Token, Mesh, trace, features.
#include <pybind11/stl.h>

#include <algorithm>
#include <optional>

#include "python/convert.h"
#include "python/device_calls.h"
#include "trace/trace.h"
#include "trace/transforms.h"

namespace bvhlab {
namespace {

// --- arguments -----------------------------------------------------------------------------------

/// Triangle indices of any integer dtype as uint32, each in range of uint32.
Array<glm::uvec3> triangle_rows(const py::handle& argument) {
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    if (kind != 'i' && kind != 'u') throw py::value_error("triangles must be an array of integers");
    if (array.ndim() != 2 || array.shape(1) != 3)
        throw py::value_error("triangles must have shape (T, 3)");
    check_triangle_count(std::size_t(array.shape(0)));  // before any copy
    using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
    using Unsigned = py::array_t<std::uint32_t, py::array::c_style>;
    Array<glm::uvec3> triangles(std::size_t(array.shape(0)));
    auto* out = reinterpret_cast<std::uint32_t*>(triangles.data());
    if (Unsigned::check_(array)) {
        const auto exact = converted<Unsigned>(array);
        std::copy_n(exact.data(), exact.size(), out);
        return triangles;
    }
    const auto wide = converted<Indices>(array);
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
        if (wide.data()[i] < 0 || wide.data()[i] > 0xFFFFFFFFLL)
            throw py::value_error("triangle " + std::to_string(i / 3) + " refers to vertex " +
                                  std::to_string(wide.data()[i]) + ", which cannot exist");
        out[i] = std::uint32_t(wide.data()[i]);
    }
    return triangles;
}

std::shared_ptr<Mesh> mesh_from_python(const py::handle& vertices, const py::handle& triangles) {
    const FloatArray rows = float_rows(vertices, "vertices", 3);
    const auto points = as_vectors(rows);
    Array<glm::vec3> positions(points.begin(), points.end());
    Array<glm::uvec3> indices = triangle_rows(triangles);
    const py::gil_scoped_release release;
    return std::make_shared<Mesh>(make_mesh(std::move(positions), std::move(indices)));
}

opencl::TraceShape shape_named(const std::string& name, const std::string& device) {
    const auto& names = opencl::trace_shape_names;
    const auto found = std::ranges::find(names, name);
    std::string known;
    for (const char* there : names) known += (known.empty() ? "" : ", ") + std::string(there);
    if (found == names.end())
        throw py::value_error("unknown shape '" + name + "'; there are: " + known);
    const auto shape = opencl::TraceShape(found - names.begin());
    if (device == "cpu" && shape != opencl::TraceShape::automatic)
        throw py::value_error("shape '" + name + "' is for OpenCL devices, not for device cpu");
    return shape;
}

// --- calls ---------------------------------------------------------------------------------------

PyHits trace_rays(const PyBvh& self, const py::object& origins, const py::object& directions,
                  const py::object& t_min, const py::object& t_max, bool any_hit,
                  const py::object& reorder, const std::string& device_id, int threads, bool count,
                  const std::shared_ptr<Token>& given_token, const std::string& triangle_test,
                  const std::string& box_test, const std::string& shape_name) {
    check_threads(threads);
    const RayArguments rays(origins, directions, t_min, t_max);
    const TraceOptions options{
        any_hit, reorder_from_python(reorder),       count,
        threads, triangle_test_named(triangle_test), box_test_named(box_test)};
    const auto token = token_or_new(given_token);
    const opencl::TraceShape shape = shape_named(shape_name, device_id);
    std::shared_ptr<opencl::Device> device;
    std::optional<TracedOnDevice> traced;
    Hits hits;
    {
        const py::gil_scoped_release release;
        device = device_named(device_id);
        if (device)
            traced = trace_on_device(*device, self, rays.batch(), options, shape, *token);
        else
            hits = trace(self.bvh, rays.batch(), options, *token);
    }
    if (!traced) return to_python(std::move(hits), any_hit, count);
    PyHits result = to_python<float>(std::move(traced->hits), any_hit, count);
    result.device = device->info().id;
    result.shape = opencl::trace_shape_names[std::size_t(traced->hits.shape)];
    result.transfer_seconds = traced->transfer_seconds;
    return result;
}

py::dict precision(const char* id, const char* label, const char* source, const char* bytes_key,
                   std::size_t bytes) {
    py::dict choice;
    choice["id"] = id;
    choice["label"] = label;
    choice["source"] = source;
    if (bytes) choice[bytes_key] = bytes;
    return choice;
}

py::dict precisions() {
    const auto triangle_test = [](TriangleTest test, const char* label, const char* source) {
        const std::size_t floats = transform_floats(test);
        return precision(triangle_test_names[std::size_t(test)], label, source,
                         "bytes_per_triangle", (floats ? floats : 9) * sizeof(float));
    };
    const auto box_test = [](BoxTest test, const char* label, const char* source) {
        return precision(box_test_names[std::size_t(test)], label, source, "", 0);
    };
    const auto layout = [](NodeLayout id, const char* label, const char* source,
                           std::size_t bytes) {
        return precision(node_layout_names[std::size_t(id)], label, source, "node_bytes", bytes);
    };
    py::list triangle_tests, box_tests, layouts;
    triangle_tests.append(triangle_test(TriangleTest::watertight, "Watertight, exact",
                                        "Woop, Benthin, Wald 2013, decided exactly"));
    triangle_tests.append(
        triangle_test(TriangleTest::moller_trumbore, "Möller–Trumbore", "Möller, Trumbore 1997"));
    triangle_tests.append(
        triangle_test(TriangleTest::woop_affine, "Woop affine", "Woop 2004; Aila, Laine 2009"));
    triangle_tests.append(
        triangle_test(TriangleTest::baldwin_weber, "Baldwin–Weber", "Baldwin, Weber 2016"));
    box_tests.append(box_test(BoxTest::conservative, "Conservative", "Ize 2013"));
    box_tests.append(box_test(BoxTest::plain, "Plain slabs", "Kay, Kajiya 1986"));
    layouts.append(layout(NodeLayout::full, "Full float", "Meister, Bittner 2022, section 3",
                          sizeof(WideNode<8>)));
    layouts.append(layout(NodeLayout::cwbvh, "Compressed 8-wide", "Ylitie, Karras, Laine 2017",
                          sizeof(CompressedNode)));
    py::dict all;
    all["triangle_test"] = triangle_tests;
    all["box_test"] = box_tests;
    all["layout"] = layouts;
    return all;
}

py::dict features() {
    py::dict features;
#ifdef BVHLAB_WITH_EMBREE
    features["embree"] = true;
#else
    features["embree"] = false;
#endif
#ifdef BVHLAB_WITH_OIIO
    features["image"] = true;
#else
    features["image"] = false;
#endif
    return features;
}

// --- classes -------------------------------------------------------------------------------------

void bind_token(py::module_& module) {
    py::register_exception<Cancelled>(module, "Cancelled", PyExc_RuntimeError);
    py::class_<Token, std::shared_ptr<Token>>(
        module, "Token", "Progress of a long call, readable from any thread, and a way to stop it.")
        .def(py::init<>())
        .def("cancel", &Token::cancel, "Makes the call raise Cancelled within 0.1 s.")
        .def_property_readonly("cancelled", &Token::cancelled)
        .def_property_readonly(
            "cost", [](const Token& token) { return token.cost(); },
            "Cost of the tree as it stands, for builders that improve one; NaN where none is.")
        .def_property_readonly("fraction", &Token::fraction, "Finished share of the stage, 0 to 1.")
        .def_property_readonly("stage", &Token::stage);
}

void bind_mesh(py::module_& module) {
    py::class_<Mesh, std::shared_ptr<Mesh>>(module, "Mesh", "Triangles, checked and copied once.")
        .def(py::init(&mesh_from_python), py::arg("vertices"), py::arg("triangles"),
             "vertices (V, 3) float32, triangles (T, 3) integers.\n\n"
             "Raises ValueError naming the first bad vertex or triangle.")
        .def_property_readonly(
            "vertices",
            [](const py::object& self) {
                const auto& mesh = self.cast<const Mesh&>();
                py::array_t<float> view({py::ssize_t(mesh.vertices.size()), py::ssize_t(3)},
                                        reinterpret_cast<const float*>(mesh.vertices.data()), self);
                view.attr("flags").attr("writeable") = false;
                return view;
            },
            "(V, 3) float32, read-only.")
        .def_property_readonly(
            "triangles",
            [](const py::object& self) {
                const auto& mesh = self.cast<const Mesh&>();
                py::array_t<std::uint32_t> view(
                    {py::ssize_t(mesh.size()), py::ssize_t(3)},
                    reinterpret_cast<const std::uint32_t*>(mesh.triangles.data()), self);
                view.attr("flags").attr("writeable") = false;
                return view;
            },
            "(T, 3) uint32, read-only.")
        .def_property_readonly(
            "bounds",
            [](const Mesh& mesh) {
                return to_numpy(Array<glm::vec3>{mesh.bounds.lower, mesh.bounds.upper});
            },
            "(2, 3) float32: lower and upper corner of all triangles.");
}

void bind_hits(py::module_& module) {
    py::class_<PyHits>(
        module, "Hits",
        "Answers by ray. A miss has t = inf and triangle = 0xFFFFFFFF; the hit point "
        "is (1-u-v) a + u b + v c. With any_hit only `occluded` is answered.")
        .def_readonly("t", &PyHits::t)
        .def_readonly("u", &PyHits::u)
        .def_readonly("v", &PyHits::v)
        .def_readonly("triangle", &PyHits::triangle)
        .def_readonly("occluded", &PyHits::occluded)
        .def_readonly("node_visits", &PyHits::node_visits)
        .def_readonly("box_tests", &PyHits::box_tests)
        .def_readonly("triangle_tests", &PyHits::triangle_tests)
        .def_readonly("key_seconds", &PyHits::key_seconds)
        .def_readonly("sort_seconds", &PyHits::sort_seconds)
        .def_readonly("traverse_seconds", &PyHits::traverse_seconds)
        .def_readonly("prepare_seconds", &PyHits::prepare_seconds,
                      "Making the triangles ready for a test with a transform: once for a tree and "
                      "test, in no other time.")
        .def_readonly("prepared_bytes", &PyHits::prepared_bytes,
                      "Bytes of those transforms, beside the tree's own.")
        .def_readonly("device", &PyHits::device, "Full id of the device that traced.")
        .def_readonly("shape", &PyHits::shape,
                      "How an OpenCL device's threads shared the work; empty on the cpu.")
        .def_readonly("transfer_seconds", &PyHits::transfer_seconds,
                      "Copying rays to an OpenCL device and answers back, and before the first "
                      "call the tree; in no other time. The other times of such a device are by "
                      "its own clock.")
        .def_property_readonly("seconds", [](const PyHits& hits) {
            return hits.key_seconds + hits.sort_seconds + hits.traverse_seconds;
        });
}

}  // namespace

void bind_core(py::module_& module) {
    bind_token(module);
    bind_mesh(module);
    bind_hits(module);
    module.def(
        "trace", &trace_rays, py::arg("bvh"), py::arg("origins"), py::arg("directions"),
        py::arg("t_min") = 0.0F, py::arg("t_max") = std::numeric_limits<float>::infinity(),
        py::arg("any_hit") = false, py::arg("reorder") = false, py::arg("device") = "cpu",
        py::arg("threads") = 0, py::arg("count") = false, py::arg("token") = nullptr,
        py::arg("triangle_test") = triangle_test_names[0], py::arg("box_test") = box_test_names[0],
        py::arg("shape") = "automatic",
        "Traces rays (N, 3) float32. `reorder` sorts them first: False or \"off\", True or "
        "\"aila\", \"origin\", \"octahedron\", \"two_point\"; hits come in the order given and "
        "are the same. `count` fills node_visits, box_tests and triangle_tests, (N,) uint32. "
        "`triangle_test` and `box_test` are ids of precisions(): with the default ones hits are "
        "exact and the same from every tree; the others are there to compare speed and error "
        "with. `device` is \"cpu\", an id of devices(), or \"opencl\" for the first of those that "
        "can be used; hits are the same. Raises ValueError naming the first bad ray, or the ids "
        "there are, RuntimeError where a device cannot be used or fails, MemoryError where its "
        "memory does not suffice. `shape` is how an OpenCL device's threads share the work: "
        "\"automatic\", \"measured\" (the fastest on the first rays, then kept), \"single\", "
        "\"persistent\" (binary), \"lanes\" (4 and 8), \"octant\" (cwbvh).");
    module.def(
        "precisions", &precisions,
        "What can be chosen between speed and error: \"triangle_test\" and \"box_test\" of "
        "trace(), \"layout\" of build(). Each a list of {\"id\", \"label\", \"source\"}, the "
        "default first; triangle tests with \"bytes_per_triangle\", what they read of one, "
        "layouts with \"node_bytes\", an 8-wide node's.");
    module.def("features", &features, "What this build of the core holds.");
}

}  // namespace bvhlab
