// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>

#include "scene/mesh.h"

namespace bvhlab::test {

/// Uniform in [low, high), the same on every platform.
inline float uniform(std::mt19937& random, float low, float high) {
    return low + (high - low) * float(random() >> 8) * 0x1p-24F;
}

inline glm::vec3 uniform_vector(std::mt19937& random, float low, float high) {
    const float x = uniform(random, low, high), y = uniform(random, low, high);
    return {x, y, uniform(random, low, high)};
}

inline std::shared_ptr<const Mesh> shared(Mesh mesh) {
    return std::make_shared<const Mesh>(std::move(mesh));
}

/// Sanitizers are many times slower and look at each access, not at sizes: of large counts they
/// get a tenth, 2500 at most.
constexpr std::size_t sanitized(std::size_t count) {
#ifdef BVHLAB_SANITIZE
    return count < 5000 ? count : std::min<std::size_t>(count / 10, 2500);
#else
    return count;
#endif
}

/// `count` separate triangles in the unit cube, of edge lengths up to `size`; see sanitized().
inline Mesh random_soup(std::size_t count, float size = 0.1F, std::uint32_t seed = 1) {
    count = sanitized(count);
    std::mt19937 random(seed);
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (std::uint32_t i = 0; i < count; ++i) {
        const glm::vec3 corner = uniform_vector(random, 0.0F, 1.0F);
        vertices.push_back(corner);
        vertices.push_back(corner + uniform_vector(random, -size, size));
        vertices.push_back(corner + uniform_vector(random, -size, size));
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return make_mesh(std::move(vertices), std::move(triangles));
}

inline Mesh scaled(Mesh mesh, float factor) {
    for (glm::vec3& vertex : mesh.vertices) vertex *= factor;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// `count` copies of one triangle; see sanitized().
inline Mesh copies(std::size_t count) {
    count = sanitized(count);
    return make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                     Array<glm::uvec3>(count, glm::uvec3(0, 1, 2)));
}

/// A closed sphere of `rows` x 2 `rows` quads around `centre`, each of two triangles.
inline Mesh sphere(int rows, glm::vec3 centre = glm::vec3(0.0F), float radius = 1.0F) {
    const int columns = 2 * rows;
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (int row = 0; row <= rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            const double theta = M_PI * row / rows, phi = 2.0 * M_PI * column / columns;
            const double sine = row == 0 || row == rows ? 0.0 : std::sin(theta);
            vertices.push_back(centre + radius * glm::vec3(float(sine * std::cos(phi)),
                                                           float(sine * std::sin(phi)),
                                                           float(std::cos(theta))));
        }
    }
    for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            const int next = (column + 1) % columns;
            const auto vertex = [&](int r, int c) { return std::uint32_t(r * columns + c); };
            triangles.push_back(
                {vertex(row, column), vertex(row + 1, column), vertex(row + 1, next)});
            triangles.push_back({vertex(row, column), vertex(row + 1, next), vertex(row, next)});
        }
    }
    return make_mesh(std::move(vertices), std::move(triangles));
}

/// Triangles of exponentially growing size along a line: a tree as deep as it is long. See
/// sanitized().
inline Mesh growing_chain(std::size_t count, double factor) {
    count = sanitized(count);
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (std::uint32_t i = 0; i < count; ++i) {
        const float x = float(std::pow(factor, double(i)) * 1e-18);
        vertices.push_back({x, 0, 0});
        vertices.push_back({x * 1.01F, x * 0.02F, 0});
        vertices.push_back({x * 1.02F, 0, x * 0.02F});
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return make_mesh(std::move(vertices), std::move(triangles));
}

}  // namespace bvhlab::test
