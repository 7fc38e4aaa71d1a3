// SPDX-License-Identifier: GPL-3.0-or-later
// Arguments from Python that are numbers of a given shape. All throw ValueError naming the
// argument.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "python/convert.h"

namespace bvhlab {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Numbers of a given shape as float64; a negative side may have any length.
DoubleArray numbers(const py::handle& argument, const char* name,
                    const std::vector<py::ssize_t>& shape, const char* shape_text);

/// Three numbers.
glm::vec3 color_argument(const py::handle& argument, const char* name);

/// An integer from `least` to `most`.
std::uint32_t count_argument(std::int64_t value, const char* name, std::int64_t least,
                             std::int64_t most);

}  // namespace bvhlab
