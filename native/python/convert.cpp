// SPDX-License-Identifier: GPL-3.0-or-later
#include "python/convert.h"

#include <cmath>
#include <stdexcept>

namespace bvhlab {
namespace {

std::string shape_text(const py::array& array) {
    std::string text = "(";
    for (py::ssize_t axis = 0; axis < array.ndim(); ++axis)
        text += (axis ? ", " : "") + std::to_string(array.shape(axis));
    return text + ")";
}

/// Not yet converted, so that its shape can be refused before anything is copied.
py::array as_numbers(const py::handle& argument, const char* name) {
    const py::array array = py::array::ensure(argument);
    if (!array) throw py::value_error(std::string(name) + " must be an array of numbers");
    const char kind = array.dtype().kind();
    if (kind != 'f' && kind != 'i' && kind != 'u')
        throw py::value_error(std::string(name) + " must be an array of numbers, not of dtype " +
                              py::str(array.dtype()).cast<std::string>());
    return array;
}

/// One value for all rays, or one a ray.
FloatArray float_per_ray(const py::handle& argument, const char* name, py::ssize_t rays) {
    const py::array array = as_numbers(argument, name);
    if (array.ndim() == 0) return array.attr("reshape")(1).cast<FloatArray>();
    if (array.ndim() == 1 && array.shape(0) == rays) return converted<FloatArray>(array);
    throw py::value_error(std::string(name) + " must be one number or of shape (" +
                          std::to_string(rays) + ",), not " + shape_text(array));
}

[[noreturn]] void refuse_ray(std::size_t ray, const std::string& why) {
    throw py::value_error("ray " + std::to_string(ray) + ": " + why);
}

bool finite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void check_ray(std::size_t i, const Ray& ray) {
    if (!finite(ray.origin)) refuse_ray(i, "the origin is not finite");
    if (!finite(ray.direction)) refuse_ray(i, "the direction is not finite");
    if (ray.direction == glm::vec3(0.0F)) refuse_ray(i, "the direction is zero");
    if (!(ray.t_min >= 0.0F) || std::isinf(ray.t_min))
        refuse_ray(i, "t_min must be finite and at least 0");
    if (std::isnan(ray.t_max)) refuse_ray(i, "t_max is not a number");
}

}  // namespace

FloatArray float_rows(const py::handle& argument, const char* name, py::ssize_t columns,
                      py::ssize_t rows) {
    const py::array array = as_numbers(argument, name);
    if (array.ndim() != 2 || array.shape(1) != columns || (rows >= 0 && array.shape(0) != rows)) {
        const std::string wanted = rows >= 0 ? std::to_string(rows) : "N";
        throw py::value_error(std::string(name) + " must have shape (" + wanted + ", " +
                              std::to_string(columns) + "), not " + shape_text(array));
    }
    if (array.shape(0) >= py::ssize_t(no_triangle))
        throw py::value_error(std::string(name) + " has " + std::to_string(array.shape(0)) +
                              " rows; a call takes at most 2^32 - 2");
    return converted<FloatArray>(array);
}

std::span<const glm::vec3> as_vectors(const FloatArray& array) {
    static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
    return {reinterpret_cast<const glm::vec3*>(array.data()), std::size_t(array.shape(0))};
}

py::array_t<float> to_numpy(Array<glm::vec3>&& array) {
    auto* owner = new Array<glm::vec3>(std::move(array));
    const py::capsule release(
        owner, [](void* pointer) { delete static_cast<Array<glm::vec3>*>(pointer); });
    return py::array_t<float>({py::ssize_t(owner->size()), py::ssize_t(3)},
                              {py::ssize_t(sizeof(glm::vec3)), py::ssize_t(sizeof(float))},
                              reinterpret_cast<const float*>(owner->data()), release);
}

RayArguments::RayArguments(const py::handle& origins, const py::handle& directions,
                           const py::handle& t_min, const py::handle& t_max)
    : origins_(float_rows(origins, "origins", 3)),
      directions_(float_rows(directions, "directions", 3, origins_.shape(0))),
      t_min_(float_per_ray(t_min, "t_min", origins_.shape(0))),
      t_max_(float_per_ray(t_max, "t_max", origins_.shape(0))) {
    const RayBatch rays = batch();
    for (std::size_t i = 0; i < rays.size(); ++i) check_ray(i, rays[i]);
}

RayBatch RayArguments::batch() const {
    return {as_vectors(origins_),
            as_vectors(directions_),
            {t_min_.data(), std::size_t(t_min_.size())},
            {t_max_.data(), std::size_t(t_max_.size())}};
}

std::shared_ptr<Token> token_or_new(const std::shared_ptr<Token>& token) {
    return token ? token : std::make_shared<Token>();
}

void check_threads(int threads) {
    if (threads < 0 || threads > 4096)
        throw py::value_error("threads must be 0 (all) to 4096, not " + std::to_string(threads));
}

Reorder reorder_from_python(const py::handle& argument) {
    if (py::isinstance<py::bool_>(argument))
        return argument.cast<bool>() ? Reorder::aila : Reorder::off;
    if (!py::isinstance<py::str>(argument))
        throw py::value_error("reorder must be True, False or a name, not " +
                              py::repr(argument).cast<std::string>());
    return reorder_named(argument.cast<std::string>());
}

}  // namespace bvhlab
