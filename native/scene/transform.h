// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <glm/mat4x4.hpp>

namespace bvhlab {

/// Whether every element is finite and the last row is 0, 0, 0, 1.
inline bool is_affine(const glm::dmat4& matrix) {
    for (int column = 0; column < 4; ++column) {
        for (int row = 0; row < 4; ++row)
            if (!std::isfinite(matrix[column][row])) return false;
        if (matrix[column][3] != (column == 3 ? 1.0 : 0.0)) return false;
    }
    return true;
}

}  // namespace bvhlab
