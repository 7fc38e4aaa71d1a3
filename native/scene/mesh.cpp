// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/mesh.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace bvhlab {
namespace {

/// Beyond this the sum of two coordinates overflows float and no box test can be trusted.
constexpr float largest_coordinate = 1e37F;

bool is_usable(float coordinate) {
    return std::abs(coordinate) <= largest_coordinate;
}

void check_vertices(const Array<glm::vec3>& vertices) {
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const glm::vec3& v = vertices[i];
        if (is_usable(v.x) && is_usable(v.y) && is_usable(v.z)) continue;
        throw std::invalid_argument("vertex " + std::to_string(i) + " is (" + std::to_string(v.x) +
                                    ", " + std::to_string(v.y) + ", " + std::to_string(v.z) +
                                    "): coordinates must be finite and at most 1e37 in size");
    }
}

void check_triangles(const Array<glm::uvec3>& triangles, std::size_t vertex_count) {
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        for (int corner = 0; corner < 3; ++corner) {
            if (triangles[i][corner] < vertex_count) continue;
            throw std::invalid_argument("triangle " + std::to_string(i) + " refers to vertex " +
                                        std::to_string(triangles[i][corner]) +
                                        ", but there are only " + std::to_string(vertex_count) +
                                        " vertices");
        }
    }
}

}  // namespace

void check_triangle_count(std::size_t count) {
    if (count == 0) throw std::invalid_argument("the mesh has no triangles");
    if (count > most_triangles)
        throw std::invalid_argument("the mesh has " + std::to_string(count) +
                                    " triangles; at most 2^28 are supported");
}

Mesh make_mesh(Array<glm::vec3> vertices, Array<glm::uvec3> triangles) {
    check_triangle_count(triangles.size());
    check_vertices(vertices);
    check_triangles(triangles, vertices.size());

    Mesh mesh{std::move(vertices), std::move(triangles)};
    for (std::size_t i = 0; i < mesh.size(); ++i) mesh.bounds.grow(mesh.box(i));
    return mesh;
}

}  // namespace bvhlab
