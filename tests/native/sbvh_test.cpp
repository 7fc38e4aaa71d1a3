// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/sbvh.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "build/clip.h"
#include "build/object_split.h"
#include "build/sah.h"
#include "build/spatial_split.h"
#include "bvh/collapse.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build(const Mesh& mesh, const SbvhConfig& config = {}) {
    Token token;
    return build_sbvh(mesh, CostModel{}, config, token);
}

/// Splits as often as anything is to be gained.
SbvhConfig eager() {
    return {.alpha = 0.0, .max_leaf_size = 1, .max_references = 16.0};
}

/// Long thin triangles in all directions: what spatial splits are for.
Mesh needles(std::size_t count, float scale = 1.0F, std::uint32_t seed = 1) {
    std::mt19937 random(seed);
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (std::uint32_t i = 0; i < count; ++i) {
        const glm::vec3 a = uniform_vector(random, 0.0F, 1.0F);
        const glm::vec3 b = uniform_vector(random, 0.0F, 1.0F);
        vertices.push_back(scale * a);
        vertices.push_back(scale * b);
        vertices.push_back(scale * (b + uniform_vector(random, -0.01F, 0.01F)));
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return make_mesh(std::move(vertices), std::move(triangles));
}

double collapsed_cost(const BinaryBvh& bvh, const Mesh& mesh) {
    Token token;
    return cost(collapse(bvh, shared(mesh), 2, CostModel{}, token), CostModel{});
}

/// Leaf boxes of each triangle.
std::vector<std::vector<Box>> boxes_by_triangle(const BinaryBvh& bvh, std::size_t triangles) {
    std::vector<std::vector<Box>> boxes(triangles);
    for (std::uint32_t leaf = bvh.first_leaf(); leaf < bvh.node_count(); ++leaf)
        boxes[bvh.reference(leaf)].push_back(bvh.boxes[leaf]);
    return boxes;
}

/// A point of the triangle, often on an edge or at a corner.
glm::dvec3 point_of(const Triangle& triangle, std::mt19937& random) {
    double weights[3];
    double sum = 0.0;
    for (double& weight : weights) {
        weight = random() % 4 == 0 ? 0.0 : double(random()) * 0x1p-32;
        sum += weight;
    }
    if (sum == 0.0) weights[0] = sum = 1.0;
    return (weights[0] * glm::dvec3(triangle.a) + weights[1] * glm::dvec3(triangle.b) +
            weights[2] * glm::dvec3(triangle.c)) /
           sum;
}

/// Whether one of the boxes holds the point, moved by up to a quarter of the pad (clip.h) on each
/// axis, but not out of the triangle's box, which all boxes are cropped to.
bool is_covered(glm::dvec3 point, const Box& whole, const std::vector<Box>& boxes,
                std::mt19937& random) {
    for (int axis = 0; axis < 3; ++axis) {
        const double low = whole.lower[axis], high = whole.upper[axis];
        const double pad = 0x1p-22 * std::max(std::abs(low), std::abs(high));
        const double shift = (double(random() % 3) - 1.0) * 0.25 * pad;
        point[axis] = std::clamp(point[axis] + shift, low, high);
    }
    return std::ranges::any_of(boxes, [&](const Box& box) {
        return point.x >= double(box.lower.x) && point.x <= double(box.upper.x) &&
               point.y >= double(box.lower.y) && point.y <= double(box.upper.y) &&
               point.z >= double(box.lower.z) && point.z <= double(box.upper.z);
    });
}

/// A plane through the box: anywhere, at a corner of the triangle or beside it.
float plane_through(const Box& box, const Triangle& triangle, int axis, std::mt19937& random) {
    const float low = box.lower[axis], high = box.upper[axis];
    float plane = uniform(random, low, high);
    if (random() % 3 == 0) plane = triangle.a[axis];
    if (random() % 3 == 0) plane = std::nextafter(plane, random() % 2 == 0 ? low : high);
    return std::clamp(plane, low, high);
}

TEST(Clip, PartsOfNestedCutsCoverTheTriangle) {
    std::mt19937 random(7);
    std::size_t parts_seen = 0;
    for (int trial = 0; trial < 3000; ++trial) {
        const float scale = std::pow(10.0F, uniform(random, -20.0F, 20.0F));
        const float offset = random() % 2 == 0 ? 0.0F : uniform(random, -1000.0F, 1000.0F);
        Triangle triangle;
        for (glm::vec3* corner : {&triangle.a, &triangle.b, &triangle.c})
            *corner = scale * (uniform_vector(random, -1.0F, 1.0F) + offset);
        if (trial % 5 == 0) triangle.b[trial % 3] = triangle.a[trial % 3];
        if (trial % 15 == 0) triangle.c[trial % 3] = triangle.a[trial % 3];
        Box whole{triangle.a, triangle.a};
        whole.grow(triangle.b);
        whole.grow(triangle.c);

        std::vector<Reference> parts{{whole, 0, 1}};
        for (int step = 0; step < 30; ++step) {
            Reference& part = parts[random() % parts.size()];
            const int axis = int(random() % 3);
            const CutBoxes boxes =
                cut(part, triangle, axis, plane_through(part.box, triangle, axis, random));
            if (boxes.left.is_empty() || boxes.right.is_empty()) continue;  // stays whole
            part.box = boxes.left;
            parts.push_back({boxes.right, 0, 1});
        }
        parts_seen += parts.size();

        std::vector<Box> padded;
        for (const Reference& part : parts) {
            padded.push_back(padded_box(part.box, whole));
            ASSERT_TRUE(whole.contains(padded.back()));
        }
        for (int sample = 0; sample < 100; ++sample)
            ASSERT_TRUE(is_covered(point_of(triangle, random), whole, padded, random))
                << "trial " << trial;
    }
    EXPECT_GT(parts_seen, 30000U);
}

TEST(Clip, CutsAreTight) {
    const Triangle triangle{{0, 0, 0}, {4, 0, 0}, {0, 4, 2}};
    const Reference reference{{{0, 0, 0}, {4, 4, 2}}, 0, 1};
    const CutBoxes boxes = cut(reference, triangle, 0, 1.0F);
    EXPECT_EQ(boxes.left.upper, glm::vec3(1, 4, 2));
    EXPECT_EQ(boxes.right.lower, glm::vec3(1, 0, 0));
    EXPECT_EQ(boxes.right.upper, glm::vec3(4, 3, 1.5F));
    EXPECT_TRUE(cut(reference, triangle, 0, 5.0F).right.is_empty());
}

TEST(Clip, TrianglesWithoutAreaStayWhole) {
    EXPECT_FALSE(is_splittable({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}));
    EXPECT_FALSE(is_splittable({{0, 0, 0}, {1, 2, 3}, {2, 4, 6}}));
    EXPECT_TRUE(is_splittable({{0, 0, 0}, {1e-40F, 0, 0}, {0, 1e-40F, 0}}));
    Mesh mesh = needles(300);
    for (glm::uvec3& corners : mesh.triangles) corners.z = corners.y;
    const BinaryBvh bvh = build(mesh, eager());
    EXPECT_NO_THROW(validate(bvh, mesh));
    EXPECT_EQ(bvh.reference_count(), mesh.size());
}

TEST(SpatialBins, FindTheBestPlane) {
    constexpr int bin_count = 16;
    Token token;
    for (std::uint32_t seed = 0; seed < 40; ++seed) {
        const Mesh mesh = random_soup(seed < 38 ? 20 : 5000, 0.7F, seed);
        const ReferenceSet set = sorted_references(mesh, token);
        double least = std::numeric_limits<double>::infinity();
        for (int axis = 0; axis < 3; ++axis) {
            for (int bin = 1; bin < bin_count; ++bin) {
                const Box& all = mesh.bounds;
                const float plane = all.lower[axis] + float(bin) / float(bin_count) *
                                                          (all.upper[axis] - all.lower[axis]);
                Box left = Box::empty(), right = Box::empty();
                std::size_t lefts = 0, rights = 0;
                for (std::uint32_t i = 0; i < mesh.size(); ++i) {
                    const CutBoxes parts = cut(set.references[i], mesh.triangle(i), axis, plane);
                    left.grow(parts.left);
                    right.grow(parts.right);
                    lefts += !parts.left.is_empty();
                    rights += !parts.right.is_empty();
                }
                if (lefts > 0 && rights > 0)
                    least = std::min(least, left.half_area() * double(lefts) +
                                                right.half_area() * double(rights));
            }
        }
        SpatialBins bins;
        const SpatialSplit split =
            find_spatial_split(set.view(0, set.size()), mesh.bounds, mesh, bin_count, 1000000,
                               std::numeric_limits<double>::infinity(), bins, token);
        EXPECT_NEAR(split.cost, least, 1e-5 * least);
    }
}

TEST(SpatialSplit, ReferenceWithAnEmptyPartStaysWhole) {
    // The box of the part with y >= 3 may be as loose as this: the triangle ends at x = 1 there.
    const Mesh mesh = make_mesh({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {3, 3, 0}, {4, 3, 0}, {3, 4, 0}},
                                {{0, 1, 2}, {3, 4, 5}});
    ReferenceSet set;
    set.resize(2);
    set.references[0] = {{{0, 3, 0}, {4, 4, 0}}, 0, 1};
    set.references[1] = {mesh.box(1), 1, 1};
    Token token;
    SpatialDivision division;
    decide_sides(set.view(0, 2), {0.0, 0, 2.0F}, mesh, 100, division, token);
    EXPECT_EQ(division.sides[0], SpatialDivision::left_side);
    EXPECT_EQ(division.sides[1], SpatialDivision::right_side);
    EXPECT_EQ(division.duplicates(), 0U);
}

TEST(SpatialSplit, KeepsTheOrdersSorted) {
    Token token;
    for (const Mesh& mesh : {needles(300), needles(5000)}) {
        const ReferenceSet set = sorted_references(mesh, token);
        const ReferenceView node = set.view(0, set.size());
        SpatialDivision division;
        decide_sides(node, {0.0, 1, 0.4F}, mesh, mesh.size(), division, token);
        ASSERT_GT(division.duplicates(), mesh.size() / 10);
        ReferenceSet sides[2];
        sides[0].resize(division.left_size);
        sides[1].resize(division.right_size);
        Array<std::uint32_t> ranks;
        divide_space(node, division, ranks, sides[0].target(0, division.left_size),
                     sides[1].target(0, division.right_size), token);
        for (const ReferenceSet& side : sides) {
            for (int axis = 0; axis < 3; ++axis) {
                Array<std::uint32_t> order = side.orders[std::size_t(axis)];
                EXPECT_TRUE(std::ranges::is_sorted(order, {}, [&](std::uint32_t position) {
                    return doubled_centre(side.references[position], axis);
                }));
                std::ranges::sort(order);
                for (std::uint32_t i = 0; i < order.size(); ++i) ASSERT_EQ(order[i], i);
            }
        }
        for (const Reference& part : division.left_parts)
            EXPECT_LE(part.box.upper.y, 0.4F) << "triangle " << part.triangle;
    }
}

TEST(Sbvh, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), random_soup(4500),
                             needles(2), needles(1000), needles(100, 1e18F), needles(100, 1e-18F),
                             needles(100, 5e36F), needles(100, 1e-40F), growing_chain(3000, 1.04),
                             growing_chain(100, 3.0), sphere(30), copies(1), copies(500)})
        for (const SbvhConfig& config : {SbvhConfig{}, eager()})
            EXPECT_NO_THROW(validate(build(mesh, config), mesh));
}

TEST(Sbvh, CopiesOfOneTriangleEndWithinTheBudget) {
    const std::size_t count = 6000;  // more than one chunk
    const Mesh mesh = make_mesh({{0, 0, 0}, {1, 0.9F, 0.8F}, {0.9F, 1, 0.7F}},
                                Array<glm::uvec3>(count, glm::uvec3(0, 1, 2)));
    const BinaryBvh bvh = build(mesh, {.max_references = 2.5});
    EXPECT_NO_THROW(validate(bvh, mesh));
    EXPECT_GT(bvh.reference_count(), count);
    EXPECT_LE(bvh.reference_count(), count * 5 / 2);
}

TEST(Sbvh, LeafBoxesCoverEveryTriangle) {
    std::mt19937 random(11);
    std::size_t references = 0;
    for (const Mesh& mesh : {needles(300), needles(300, 1e15F), needles(300, 1e-15F),
                             needles(4500)}) {  // the last is more than one chunk
        const BinaryBvh bvh = build(mesh, eager());
        references += bvh.reference_count();
        const auto boxes = boxes_by_triangle(bvh, mesh.size());
        for (std::size_t i = 0; i < mesh.size(); ++i)
            for (int sample = 0; sample < 20; ++sample)
                ASSERT_TRUE(
                    is_covered(point_of(mesh.triangle(i), random), mesh.box(i), boxes[i], random));
    }
    EXPECT_GT(references, 2U * 5400U);  // there were cuts to test
}

TEST(Sbvh, CostsLessThanObjectSplits) {
    const Mesh mesh = needles(2000);
    Token token;
    const double without = collapsed_cost(build_sah(mesh, CostModel{}, token), mesh);
    EXPECT_LT(collapsed_cost(build(mesh), mesh), 0.9 * without);
}

TEST(Sbvh, WithoutSpatialSplitsIsSah) {
    const Mesh mesh = needles(4500);
    Token token;
    const BinaryBvh sah = build_sah(mesh, CostModel{}, token);
    EXPECT_TRUE(same(sah, build(mesh, {.max_spatial_depth = 0})));
    EXPECT_TRUE(same(sah, build(mesh, {.max_references = 1.0})));
    EXPECT_FALSE(same(sah, build(mesh)));
}

TEST(Sbvh, SmallerLeavesAreSplitOn) {
    const Mesh mesh = needles(500);
    EXPECT_LT(build(mesh, {.max_leaf_size = 8}).reference_count(),
              build(mesh, {.max_leaf_size = 1}).reference_count());
}

TEST(Sbvh, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    const Mesh mesh = needles(5000);
    const BinaryBvh one = with_threads(1, [&] { return build(mesh); });
    const BinaryBvh many = with_threads(7, [&] { return build(mesh); });
    EXPECT_TRUE(same(one, many));
    EXPECT_GT(one.reference_count(), mesh.size());
}

TEST(Sbvh, IsTheSameForAnyInstructionSet) {
    const Mesh mesh = needles(300);
    const BinaryBvh best = build(mesh);
    const auto supported = hwy::SupportedTargets();
    for (auto target = supported & -supported, rest = supported; rest != 0;
         rest &= rest - 1, target = rest & -rest) {
        hwy::SetSupportedTargetsForTest(target);
        EXPECT_TRUE(same(best, build(mesh))) << hwy::TargetName(target);
    }
    hwy::SetSupportedTargetsForTest(0);
}

TEST(Sbvh, ParametersAreTheConfig) {
    const BuilderInfo& info = find_builder("sbvh");
    const SbvhConfig defaults = sbvh_config(check_parameters(info, {}));
    EXPECT_EQ(defaults.alpha, 1e-5);
    EXPECT_EQ(defaults.spatial_bins, 128);
    EXPECT_EQ(defaults.max_spatial_depth, 48);
    EXPECT_EQ(defaults.max_leaf_size, 8);
    const Parameters given{{"alpha", 0.5},
                           {"spatial_bins", 16},
                           {"max_spatial_depth", 3},
                           {"max_references", 2},
                           {"max_leaf_size", 4}};
    const SbvhConfig config = sbvh_config(check_parameters(info, given));
    EXPECT_EQ(config.alpha, 0.5);
    EXPECT_EQ(config.spatial_bins, 16);
    EXPECT_EQ(config.max_spatial_depth, 3);
    EXPECT_EQ(config.max_leaf_size, 4);
    EXPECT_EQ(config.max_references, 2.0);
    EXPECT_THROW(check_parameters(info, {{"spatial_bins", 257}}), std::invalid_argument);
}

TEST(Sbvh, StopsWhenCancelled) {
    Token early;
    early.cancel();
    EXPECT_THROW(build_sbvh(needles(10), CostModel{}, {}, early), Cancelled);

    // Whatever is under way when it is cancelled, nothing goes on with half a result.
    const Mesh mesh = needles(30000);
    for (int milliseconds = 0; milliseconds < 60; milliseconds += 4) {
        Token token;
        std::thread other([&] {
            std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
            token.cancel();
        });
        EXPECT_THROW(build_sbvh(mesh, CostModel{}, {}, token), Cancelled);
        other.join();
        EXPECT_LT(token.fraction(), 1.0F);
    }
}

}  // namespace
}  // namespace bvhlab
