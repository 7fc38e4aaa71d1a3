// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <new>
#include <string>

#include "base/token.h"
#include "python/trees.h"
#include "scene/mesh.h"
#include "trace/ray.h"
#include "trace/reorder.h"

namespace bvhlab {

namespace py = pybind11;

/// Float32 or float64 array of any shape, converted to contiguous float32 if it is not already.
using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;

/// An array of numbers as an array of another type. Throws std::bad_alloc where that cannot be had:
/// pybind11's own ensure() gives a null array then, which crashes whoever looks into it.
template <class To>
To converted(const py::array& numbers) {
    To result = To::ensure(numbers);
    if (!result) throw std::bad_alloc();
    return result;
}

/// An array argument as contiguous float32 of shape (N, columns); N is free where `rows` is
/// negative. Throws ValueError naming the argument for a non-numeric dtype or another shape.
FloatArray float_rows(const py::handle& argument, const char* name, py::ssize_t columns,
                      py::ssize_t rows = -1);

/// The rows of a (N, 3) array as vectors, without a copy; the array must outlive the span.
std::span<const glm::vec3> as_vectors(const FloatArray& array);

/// Ray arguments of every tracing function: keeps the numpy arrays alive and offers them as a
/// batch. Throws ValueError naming the first ray that is not finite, has a zero direction, or a bad
/// interval.
class RayArguments {
public:
    RayArguments(const py::handle& origins, const py::handle& directions, const py::handle& t_min,
                 const py::handle& t_max);
    RayBatch batch() const;

private:
    FloatArray origins_, directions_, t_min_, t_max_;
};

/// Moves an array into numpy without a copy; the numpy array owns it.
template <class T>
py::array_t<T> to_numpy(Array<T>&& array) {
    auto* owner = new Array<T>(std::move(array));
    const py::capsule release(owner, [](void* pointer) { delete static_cast<Array<T>*>(pointer); });
    return py::array_t<T>({py::ssize_t(owner->size())}, {py::ssize_t(sizeof(T))}, owner->data(),
                          release);
}

/// Moves an array of vectors into numpy as (N, 3) float32 without a copy.
py::array_t<float> to_numpy(Array<glm::vec3>&& array);

/// What core.trace, core.brute_force and EmbreeScene.trace return (class `Hits` in Python).
struct PyHits {
    py::object t, u, v, triangle, occluded, node_visits, box_tests, triangle_tests;
    double key_seconds = 0, sort_seconds = 0, traverse_seconds = 0, prepare_seconds = 0;
    double transfer_seconds = 0;
    std::size_t prepared_bytes = 0;
    std::string device = "cpu", shape;
};

/// Hits as numpy arrays; the arrays that were not asked for are None.
template <class Real>
PyHits to_python(HitsOf<Real>&& hits, bool any_hit, bool counted) {
    const auto give = [](bool wanted, auto&& array) -> py::object {
        if (!wanted) return py::none();
        return to_numpy(std::move(array));
    };
    PyHits result;
    result.t = give(!any_hit, hits.t);
    result.u = give(!any_hit, hits.u);
    result.v = give(!any_hit, hits.v);
    result.triangle = give(!any_hit, hits.triangle);
    result.occluded = to_numpy(std::move(hits.occluded)).view("bool");
    result.node_visits = give(counted, hits.node_visits);
    result.box_tests = give(counted, hits.box_tests);
    result.triangle_tests = give(counted, hits.triangle_tests);
    result.key_seconds = hits.key_seconds;
    result.sort_seconds = hits.sort_seconds;
    result.traverse_seconds = hits.traverse_seconds;
    result.prepare_seconds = hits.prepare_seconds;
    result.prepared_bytes = hits.prepared_bytes;
    return result;
}

/// The token argument: the one given, or a fresh one for None.
std::shared_ptr<Token> token_or_new(const std::shared_ptr<Token>& token);

/// Throws ValueError unless 0 <= threads <= 4096.
void check_threads(int threads);

/// The `reorder` argument of every function that traces: True or False, or a name of
/// reorder_names. Throws ValueError for anything else.
Reorder reorder_from_python(const py::handle& argument);

void bind_core(py::module_& module);       // Token, Mesh, trace, features
void bind_device(py::module_& module);     // devices
void bind_build(py::module_& module);      // builders, build_tree, Tree, build, Bvh
void bind_metrics(py::module_& module);    // metrics
void bind_reference(py::module_& module);  // brute_force, embree, EmbreeScene
void bind_scene(py::module_& module);      // Camera, Light, World, Texture, Material, Scene
void bind_render(py::module_& module);     // rays, render
void bind_image(py::module_& module);      // write_image, image_difference

}  // namespace bvhlab
