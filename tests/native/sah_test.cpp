// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/sah.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build(const Mesh& mesh) {
    Token token;
    return build_sah(mesh, CostModel{}, token);
}

/// A square of `side` x `side` cells: all orders have many equal centres.
Mesh grid(std::uint32_t side) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (std::uint32_t y = 0; y <= side; ++y)
        for (std::uint32_t x = 0; x <= side; ++x) vertices.push_back({float(x), float(y), 0.0F});
    for (std::uint32_t y = 0; y < side; ++y) {
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t corner = y * (side + 1) + x;
            triangles.push_back({corner, corner + 1, corner + side + 2});
            triangles.push_back({corner, corner + side + 2, corner + side + 1});
        }
    }
    return make_mesh(std::move(vertices), std::move(triangles));
}

/// Points and segments only.
Mesh without_area(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (std::size_t i = 0; i < mesh.size(); ++i) {
        glm::uvec3& corners = mesh.triangles[i];
        corners.z = corners.y;
        if (i % 2 == 0) corners.y = corners.z = corners.x;
    }
    return mesh;
}

/// Triangles one behind the other on the x axis.
Mesh collinear(std::size_t count) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (std::uint32_t i = 0; i < count; ++i) {
        for (int corner = 0; corner < 3; ++corner)
            vertices.push_back({float(i) + 0.25F * float(corner), 0.0F, 0.0F});
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return make_mesh(std::move(vertices), std::move(triangles));
}

std::size_t depth(const BinaryBvh& bvh) {
    std::vector<std::size_t> depths(bvh.node_count(), 0);
    std::size_t deepest = 0;
    for (std::uint32_t node = 0; node < bvh.children.size(); ++node) {  // parents come first
        for (const std::uint32_t child : {bvh.children[node].left, bvh.children[node].right}) {
            depths[child] = depths[node] + 1;
            deepest = std::max(deepest, depths[child]);
        }
    }
    return deepest;
}

TEST(Sah, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh :
         {random_soup(1), random_soup(2), random_soup(3), random_soup(20000), random_soup(5000, 2),
          grid(60), sphere(40), without_area(1), without_area(6000), collinear(5000),
          scaled(random_soup(5000), 1e18F), scaled(random_soup(5000), 1e-18F),
          scaled(random_soup(5000), 5e36F), scaled(random_soup(5000), 1e-40F)}) {
        const BinaryBvh bvh = build(mesh);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_EQ(bvh.reference_count(), mesh.size());
    }
}

TEST(Sah, DividesEqualCentresEvenly) {
    EXPECT_EQ(depth(build(copies(8))), 3U);
    EXPECT_EQ(depth(build(copies(4097))), 13U);
    EXPECT_EQ(depth(build(copies(3))), 2U);
}

TEST(Sah, TakesChainsOfGrowingTriangles) {
    for (const double factor : {1.02, 1.04}) {
        const Mesh mesh = growing_chain(3000, factor);
        EXPECT_NO_THROW(validate(build(mesh), mesh));
    }
    const Mesh steep = growing_chain(100, 3.0);  // each step takes off one triangle
    const BinaryBvh bvh = build(steep);
    EXPECT_NO_THROW(validate(bvh, steep));
    EXPECT_GT(depth(bvh), 40U);
}

/// Sum over both sides of half area times count, the least over all divisions in centre order.
double least_cost(const Mesh& mesh, std::vector<std::uint32_t> triangles) {
    double least = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        std::ranges::stable_sort(triangles, {}, [&](std::uint32_t triangle) {
            return mesh.box(triangle).doubled_centre()[axis];
        });
        for (std::size_t left = 1; left < triangles.size(); ++left) {
            Box boxes[2] = {Box::empty(), Box::empty()};
            for (std::size_t i = 0; i < triangles.size(); ++i)
                boxes[i >= left].grow(mesh.box(triangles[i]));
            least = std::min(least, boxes[0].half_area() * double(left) +
                                        boxes[1].half_area() * double(triangles.size() - left));
        }
    }
    return least;
}

/// Checks every node below `node` and returns its triangles.
std::vector<std::uint32_t> check_optimal(const Mesh& mesh, const BinaryBvh& bvh,
                                         std::uint32_t node) {
    if (bvh.is_leaf(node)) return {bvh.reference(node)};
    const auto [left, right] = bvh.children[node];
    std::vector<std::uint32_t> triangles = check_optimal(mesh, bvh, left);
    const std::size_t left_size = triangles.size();
    const std::vector<std::uint32_t> others = check_optimal(mesh, bvh, right);
    triangles.insert(triangles.end(), others.begin(), others.end());
    std::ranges::sort(triangles);
    EXPECT_EQ(bvh.boxes[left].half_area() * double(left_size) +
                  bvh.boxes[right].half_area() * double(others.size()),
              least_cost(mesh, triangles));
    return triangles;
}

TEST(Sah, EverySplitIsTheBestOfTheSweep) {
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
        const Mesh mesh = random_soup(40, seed % 2 == 0 ? 0.1F : 1.0F, seed);
        check_optimal(mesh, build(mesh), 0);
    }
}

TEST(Sah, RootSplitOfALargeNodeIsTheBestOfTheSweep) {
    const Mesh mesh = random_soup(10000);  // more than one chunk
    const BinaryBvh bvh = build(mesh);
    const auto [left, right] = bvh.children[0];  // as many nodes before the right one as leaves
    const double left_size = bvh.is_leaf(right) ? double(mesh.size() - 1) : double(right);
    const double cost = bvh.boxes[left].half_area() * left_size +
                        bvh.boxes[right].half_area() * (double(mesh.size()) - left_size);

    double least = std::numeric_limits<double>::infinity();
    std::vector<std::uint32_t> order(mesh.size());
    std::vector<double> areas(mesh.size());
    for (int axis = 0; axis < 3; ++axis) {
        for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
        std::ranges::stable_sort(order, {}, [&](std::uint32_t triangle) {
            return mesh.box(triangle).doubled_centre()[axis];
        });
        Box box = Box::empty();
        for (std::size_t i = order.size(); i-- > 0;) {
            box.grow(mesh.box(order[i]));
            areas[i] = box.half_area();
        }
        box = Box::empty();
        for (std::size_t i = 1; i < order.size(); ++i) {
            box.grow(mesh.box(order[i - 1]));
            least =
                std::min(least, box.half_area() * double(i) + areas[i] * double(order.size() - i));
        }
    }
    EXPECT_EQ(cost, least);
}

TEST(Sah, NumbersNodesDepthFirst) {
    const BinaryBvh bvh = build(random_soup(9000));
    std::vector<std::uint32_t> waiting{0};
    std::uint32_t next_node = 0, next_leaf = bvh.first_leaf();
    while (!waiting.empty()) {
        const std::uint32_t node = waiting.back();
        waiting.pop_back();
        ASSERT_EQ(node, bvh.is_leaf(node) ? next_leaf++ : next_node++);
        if (bvh.is_leaf(node)) continue;
        waiting.push_back(bvh.children[node].right);
        waiting.push_back(bvh.children[node].left);
    }
}

TEST(Sah, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    for (const Mesh& mesh : {random_soup(30000), grid(120)}) {
        const BinaryBvh one = with_threads(1, [&] { return build(mesh); });
        const BinaryBvh many = with_threads(7, [&] { return build(mesh); });
        EXPECT_TRUE(same(one, many));
    }
}

TEST(Sah, StopsWhenCancelled) {
    Token token;
    token.cancel();
    EXPECT_THROW(build_sah(random_soup(10), CostModel{}, token), Cancelled);
    EXPECT_THROW(build_sah(random_soup(10000), CostModel{}, token), Cancelled);
}

TEST(Sah, ReportsProgress) {
    Token token;
    build_sah(random_soup(20000), CostModel{}, token);
    EXPECT_STREQ(token.stage(), "building SAH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
}

}  // namespace
}  // namespace bvhlab
