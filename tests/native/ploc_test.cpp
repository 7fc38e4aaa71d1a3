// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/ploc.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "build/morton_order.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"
#include "topology.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build(const Mesh& mesh, const PlocConfig& config = {}) {
    Token token;
    return build_ploc(mesh, config, token);
}

/// The builder again, slow and plain, for meshes whose longest side is 1 to 2 (no scaling) and of
/// at most 256 triangles (no stalled rows).
std::string plain_ploc(const Mesh& mesh, const PlocConfig& config) {
    struct Cluster {
        Box box;
        std::string tree;
    };
    const auto distance = [](const Cluster& a, const Cluster& b) {
        const Box box = unite(a.box, b.box);
        const glm::vec3 size = box.upper - box.lower;
        return size.x * size.y + size.z * (size.x + size.y);
    };
    std::vector<Cluster> row;
    for (const std::uint32_t triangle : morton_order(mesh, Token()).references)
        row.push_back({mesh.box(triangle), std::to_string(triangle)});

    double radius = std::min(config.radius, config.first_radius);
    while (row.size() > 1) {
        std::vector<std::size_t> nearest(row.size(), row.size());
        for (std::size_t i = 0; i < row.size(); ++i)
            for (std::size_t j = 0; j < row.size(); ++j)
                if (j != i && std::abs(double(i) - double(j)) <= std::floor(radius) &&
                    (nearest[i] == row.size() ||
                     distance(row[i], row[j]) < distance(row[i], row[nearest[i]])))
                    nearest[i] = j;
        std::vector<Cluster> next;
        for (std::size_t i = 0; i < row.size(); ++i) {
            const std::size_t j = nearest[i];
            if (nearest[j] != i)
                next.push_back(row[i]);
            else if (i < j)
                next.push_back({unite(row[i].box, row[j].box), joined(row[i].tree, row[j].tree)});
        }
        row = next;
        radius = std::min(radius * config.growth, double(config.radius));
    }
    return row[0].tree;
}

/// Every triangle `times` times, not in a row.
Mesh repeated(Mesh mesh, int times) {
    const std::size_t count = mesh.size();
    for (int i = 1; i < times; ++i)
        for (std::size_t j = 0; j < count; ++j) mesh.triangles.push_back(mesh.triangles[j]);
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

std::size_t depth(const BinaryBvh& bvh) {
    std::vector<std::size_t> depths(bvh.node_count(), 0);
    for (std::uint32_t node = 0; node < bvh.children.size(); ++node)  // parents come first
        for (const std::uint32_t child : {bvh.children[node].left, bvh.children[node].right})
            depths[child] = depths[node] + 1;
    return std::ranges::max(depths);
}

TEST(Ploc, IsThePlainOne) {
    for (const PlocConfig& config :
         {PlocConfig{}, PlocConfig{.radius = 1}, PlocConfig{.radius = 5}, PlocConfig{.radius = 512},
          PlocConfig{.radius = 16}, PlocConfig{.radius = 100, .first_radius = 3, .growth = 1.5}})
        for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), random_soup(33),
                                 random_soup(250), random_soup(250, 0.4F, 2),
                                 repeated(random_soup(80), 3), copies(200), sphere(7, {}, 0.9F)})
            EXPECT_EQ(topology(build(mesh, config)), plain_ploc(mesh, config));
}

TEST(Ploc, DoesNotDependOnScale) {
    const Mesh mesh = random_soup(3000);
    const std::string expected = topology(build(mesh));
    for (const float factor : {0x1p100F, 0x1p-80F})
        EXPECT_EQ(topology(build(scaled(mesh, factor))), expected);
}

TEST(Ploc, MergesAFlatMeshFarFromTheOrigin) {
    Mesh mesh = random_soup(2000);
    for (glm::vec3& vertex : mesh.vertices) vertex = {vertex.x * 1e-30F, vertex.y * 1e-30F, 1e30F};
    mesh = make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
    EXPECT_NO_THROW(validate(build(mesh), mesh));
    EXPECT_LT(depth(build(mesh)), 60U);
}

TEST(Ploc, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), random_soup(20000),
                             copies(1), sphere(40), repeated(random_soup(300), 50)})
        EXPECT_NO_THROW(validate(build(mesh), mesh));
}

/// By the mutual pairs alone each of these would take about as many iterations as triangles.
TEST(Ploc, EndsSoonOnStalledRows) {
    for (const Mesh& mesh : {copies(100000), growing_chain(100000, 1.0008)}) {
        const BinaryBvh bvh = build(mesh);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_LT(depth(bvh), 1000U);
    }
}

TEST(Ploc, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    for (const Mesh& mesh : {random_soup(50000), copies(50000)})
        EXPECT_TRUE(same(with_threads(1, [&] { return build(mesh); }),
                         with_threads(7, [&] { return build(mesh); })));
}

TEST(Ploc, IsTheSameOnEveryInstructionSet) {
    for (const Mesh& mesh : {random_soup(5000), repeated(random_soup(700), 3)}) {
        const BinaryBvh expected = build(mesh);
        for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
            hwy::SetSupportedTargetsForTest(target);
            EXPECT_TRUE(same(build(mesh), expected)) << hwy::TargetName(target);
            hwy::SetSupportedTargetsForTest(0);
        }
    }
}

TEST(Ploc, StopsWhenCancelled) {
    Token token;
    token.cancel();
    EXPECT_THROW(build_ploc(random_soup(10), {}, token), Cancelled);
}

TEST(Ploc, ReportsProgress) {
    Token token;
    build_ploc(random_soup(2000), {}, token);
    EXPECT_STREQ(token.stage(), "building PLOC");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
}

}  // namespace
}  // namespace bvhlab
