// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "base/array.h"
#include "scene/box.h"

namespace bvhlab {

/// Index of a triangle that is not there: a miss.
inline constexpr std::uint32_t no_triangle = 0xFFFFFFFFU;

/// Triangles of a mesh at most, so that node and block numbers fit in 32 bits.
inline constexpr std::size_t most_triangles = std::size_t(1) << 28;

/// Corners of one triangle.
struct Triangle {
    glm::vec3 a, b, c;
};

/// Triangles in world space. Once made it is trusted: indices in range, coordinates finite, at
/// least one triangle and at most most_triangles.
struct Mesh {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    Box bounds = Box::empty();  ///< of all triangles; vertices that no triangle uses do not count

    std::size_t size() const { return triangles.size(); }

    Triangle triangle(std::size_t index) const {
        const glm::uvec3& corners = triangles[index];
        return {vertices[corners.x], vertices[corners.y], vertices[corners.z]};
    }

    Box box(std::size_t index) const {
        const Triangle corners = triangle(index);
        Box box{corners.a, corners.a};
        box.grow(corners.b);
        box.grow(corners.c);
        return box;
    }
};

/// Throws std::invalid_argument where a mesh cannot have so many triangles.
void check_triangle_count(std::size_t count);

/// Checks the arrays and computes the bounds.
/// Throws std::invalid_argument naming the first bad vertex or triangle.
Mesh make_mesh(Array<glm::vec3> vertices, Array<glm::uvec3> triangles);

}  // namespace bvhlab
