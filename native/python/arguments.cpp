// SPDX-License-Identifier: GPL-3.0-or-later
#include "python/arguments.h"

#include <string>

namespace bvhlab {
namespace {

bool has_shape(const py::array& array, const std::vector<py::ssize_t>& shape) {
    if (array.ndim() != py::ssize_t(shape.size())) return false;
    for (py::ssize_t axis = 0; axis < array.ndim(); ++axis) {
        const py::ssize_t side = shape[std::size_t(axis)];
        if (side >= 0 && array.shape(axis) != side) return false;
    }
    return true;
}

}  // namespace

DoubleArray numbers(const py::handle& argument, const char* name,
                    const std::vector<py::ssize_t>& shape, const char* shape_text) {
    const py::array array = py::array::ensure(argument);
    const char kind = array ? array.dtype().kind() : '?';
    const bool fits = (kind == 'f' || kind == 'i' || kind == 'u') && has_shape(array, shape);
    PyErr_Clear();
    if (!fits) throw py::value_error(std::string(name) + " must be numbers of shape " + shape_text);
    return converted<DoubleArray>(array);
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

}  // namespace bvhlab
