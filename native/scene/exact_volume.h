// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <glm/vec3.hpp>

#include "base/exact_sum.h"

namespace bvhlab {

/// Adds det(x, y, z).
void add_determinant(ExactSum& sum, const glm::vec3& x, const glm::vec3& y, const glm::vec3& z);

/// det(direction, p - origin, q - origin), without rounding: its sign says on which side of the ray
/// the edge from p to q passes, 0 that they meet.
ExactSum exact_volume(const glm::vec3& origin, const glm::vec3& direction, const glm::vec3& p,
                      const glm::vec3& q);

}  // namespace bvhlab
