// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "build/builder.h"
#include "bvh/collapse.h"
#include "meshes.h"

/// Trees and meshes for the tests of metrics.
namespace bvhlab::test {

/// Stands for a branching factor: 8 in compressed nodes.
inline constexpr unsigned compressed = 80;

inline Bvh build(std::shared_ptr<const Mesh> mesh, const std::string& id, unsigned branching,
                 const CostModel& model = {}) {
    Token token;
    BuildLog log;
    const BuilderInfo& builder = find_builder(id);
    const BinaryBvh binary = builder.build(*mesh, model, check_parameters(builder, {}), token, log);
    if (branching == compressed) return compress(binary, std::move(mesh), model, token);
    return collapse(binary, std::move(mesh), branching, model, token);
}

/// Independent triangles from their corners.
inline std::shared_ptr<const Mesh> triangles(const std::vector<Triangle>& list) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> indices;
    for (const Triangle& t : list) {
        const auto first = std::uint32_t(vertices.size());
        vertices.insert(vertices.end(), {t.a, t.b, t.c});
        indices.push_back({first, first + 1, first + 2});
    }
    return shared(make_mesh(std::move(vertices), std::move(indices)));
}

/// For trees of one leaf a triangle: tests are so dear that no leaf holds two.
inline const CostModel single_leaves{1.0, 1e5};

/// Even for triangles in one place: interior nodes cost less than nothing.
inline Bvh with_smallest_leaves(const std::shared_ptr<const Mesh>& mesh, unsigned branching) {
    Token token;
    BuildLog log;
    const BinaryBvh binary = find_builder("sah").build(*mesh, {}, {}, token, log);
    Bvh bvh = collapse(binary, mesh, branching, {-1.0, 1e5}, token);
    EXPECT_TRUE(branching > 2 || bvh.leaf_count == mesh->size());  // wider ones pay by the group
    return bvh;
}

/// Walls and floors on a grid, so that many triangles lie in the faces of boxes.
inline Mesh rooms(std::uint32_t seed) {
    std::mt19937 random(seed);
    Array<glm::vec3> vertices;
    Array<glm::uvec3> indices;
    for (std::uint32_t i = 0; i < 150; ++i) {
        glm::vec3 corner = glm::floor(uniform_vector(random, 0.0F, 4.0F));
        const int axis = int(random() % 3);
        glm::vec3 u(0.0F), v(0.0F);
        u[(axis + 1) % 3] = float(1 + random() % 2);
        v[(axis + 2) % 3] = float(1 + random() % 3);
        vertices.insert(vertices.end(), {corner, corner + u, corner + v});
        indices.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return make_mesh(std::move(vertices), std::move(indices));
}

}  // namespace bvhlab::test
