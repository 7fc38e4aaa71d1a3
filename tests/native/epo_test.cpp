// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/epo.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <type_traits>
#include <vector>

#include "base/parallel.h"
#include "metrics_samples.h"

namespace bvhlab {
namespace {

using test::build;
using test::compressed;
using test::copies;
using test::random_soup;
using test::rooms;
using test::shared;
using test::single_leaves;
using test::sphere;
using test::triangles;
using test::with_smallest_leaves;

double epo(const Bvh& bvh, const CostModel& model = {}) {
    Token token;
    return end_point_overlap(bvh, model, token);
}

using Point = std::array<long double, 3>;

/// The part of the triangle in the box, cut from the whole triangle with every plane in turn.
long double area_inside(const Triangle& triangle, const Box& box) {
    std::vector<Point> polygon;
    for (const glm::vec3& v : {triangle.a, triangle.b, triangle.c})
        polygon.push_back({v.x, v.y, v.z});
    for (int axis = 2; axis >= 0; --axis) {
        for (const bool upper : {true, false}) {
            const long double plane = upper ? box.upper[axis] : box.lower[axis];
            std::vector<Point> kept;
            for (std::size_t i = 0; i < polygon.size(); ++i) {
                const Point &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
                const long double from = upper ? plane - p[axis] : p[axis] - plane;
                const long double to = upper ? plane - q[axis] : q[axis] - plane;
                if (from >= 0) kept.push_back(p);
                if ((from > 0 && to < 0) || (from < 0 && to > 0)) {
                    // Formed as it is so that a flat triangle stays exactly in its plane.
                    Point cut;
                    for (int j = 0; j < 3; ++j) cut[j] = p[j] + (q[j] - p[j]) * from / (from - to);
                    cut[axis] = plane;
                    kept.push_back(cut);
                }
            }
            polygon = kept;
        }
    }
    long double normal[3] = {0, 0, 0};
    for (std::size_t i = 2; i < polygon.size(); ++i) {
        for (int j = 0; j < 3; ++j) {
            const int k = (j + 1) % 3, l = (j + 2) % 3;
            const Point &o = polygon[0], &p = polygon[i - 1], &q = polygon[i];
            normal[j] += (p[k] - o[k]) * (q[l] - o[l]) - (p[l] - o[l]) * (q[k] - o[k]);
        }
    }
    return std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) / 2;
}

/// Adds C_n times the outside area of every node below `node`, of whose box rays reach `reach`;
/// returns the triangles below it.
template <class Tree>
std::set<std::uint32_t> add_overlaps(const Mesh& mesh, const Tree& wide, std::uint32_t node,
                                     const Box& reach, const CostModel& model, long double& sum) {
    constexpr unsigned K = Tree::branching;
    constexpr unsigned group = K == 2 || std::is_same_v<Tree, CompressedBvh> ? 1 : K;
    std::set<std::uint32_t> all;
    const WideNode<K>& parent = wide.node(node);
    for (unsigned i = 0; i < K && !parent.is_missing(i); ++i) {
        std::set<std::uint32_t> own;
        long double work = model.traversal;
        const Box box = intersect(parent.box(i), reach);
        if (parent.is_leaf(i)) {
            for (std::uint32_t lane = 0; lane < parent.count[i]; ++lane)
                own.insert(wide.reference(parent.child[i], lane));
            work = model.intersection * double((parent.count[i] + group - 1) / group * group);
        } else {
            own = add_overlaps(mesh, wide, parent.child[i], box, model, sum);
        }
        for (std::uint32_t t = 0; t < mesh.size(); ++t)
            if (!own.contains(t)) sum += work * area_inside(mesh.triangle(t), box);
        all.insert(own.begin(), own.end());
    }
    return all;
}

double brute_epo(const Bvh& bvh, const CostModel& model) {
    const Mesh& mesh = *bvh.mesh;
    long double sum = 0, area = 0;
    std::visit([&](const auto& wide) { add_overlaps(mesh, wide, 0, mesh.bounds, model, sum); },
               bvh.tree);
    for (std::size_t t = 0; t < mesh.size(); ++t)
        area += area_inside(mesh.triangle(t), mesh.bounds);
    return double(sum / area);
}

TEST(EndPointOverlap, IsThatOfEveryTriangleCutByEveryNode) {
    const CostModel models[] = {{3.0, 2.0}, {1.5, 0.25}};  // the second makes larger leaves
    const std::vector<Mesh> meshes = {random_soup(300, 0.1F, 5), random_soup(120, 0.6F, 6),
                                      rooms(7), sphere(7)};
    for (const Mesh& plain : meshes) {
        const auto mesh = shared(Mesh(plain));
        for (const char* builder : {"lbvh", "sah", "sbvh"}) {
            for (const unsigned branching : {2U, 4U, 8U, compressed}) {
                for (const CostModel& model : models) {
                    const Bvh bvh = build(mesh, builder, branching, model);
                    const double expected = brute_epo(bvh, model);
                    EXPECT_GT(expected, 0.0);
                    EXPECT_NEAR(epo(bvh, model), expected, 1e-11 * expected)
                        << builder << " " << branching;
                }
            }
        }
    }
}

TEST(EndPointOverlap, OfSpatialSplitsCountsTheirTrianglesAsTheirOwn) {
    // A long thin roof over small triangles: SBVH cuts it, which is what it is for.
    std::vector<Triangle> list;
    for (int i = 0; i < 64; ++i) {
        const auto x = float(i);
        list.push_back({{x, 0, x}, {x + 0.5F, 0, x}, {x, 0.5F, x}});
    }
    list.push_back({{0, 0, 0}, {64, 0, 64}, {64, 0.5F, 64}});
    const auto mesh = triangles(list);
    const Bvh split = build(mesh, "sbvh", 4), whole = build(mesh, "sah", 4);
    ASSERT_GT(split.reference_count, mesh->size());
    EXPECT_NEAR(epo(split), brute_epo(split, {}), 1e-11 * epo(split));
    EXPECT_LT(epo(split), epo(whole));
}

TEST(EndPointOverlap, OfTwoTrianglesIsTheirShareInEachOthersBox) {
    // Upright at x = 1, from the origin to 4: its part in the box [0, 2]^3 of the slanted one is
    // the square [0, 2]^2. The slanted one meets the plane x = 1 in a line only.
    const auto mesh =
        triangles({{{0, 0, 0}, {2, 0, 0}, {0, 2, 2}}, {{1, 0, 0}, {1, 4, 0}, {1, 0, 4}}});
    const Bvh bvh = build(mesh, "sah", 2, single_leaves);
    ASSERT_EQ(bvh.leaf_count, 2U);
    const double slanted = 2.0 * std::sqrt(2.0), upright = 8.0;
    EXPECT_NEAR(epo(bvh, single_leaves), single_leaves.intersection * 4.0 / (slanted + upright),
                1e-6);
}

TEST(EndPointOverlap, IsNothingWhereBoxesAreApart) {
    std::vector<Triangle> list;
    for (int i = 0; i < 100; ++i) {
        const auto x = float(2 * i);
        list.push_back({{x, 0, 0}, {x + 1, 0, 1}, {x, 1, 0}});
    }
    for (const unsigned branching : {2U, 4U, 8U})
        EXPECT_EQ(epo(build(triangles(list), "sah", branching)), 0.0);
}

TEST(EndPointOverlap, OfTrianglesInOnePlaceCountsEachInEveryOtherLeaf) {
    std::vector<Triangle> nested;  // a smaller one lies in all boxes of larger ones
    for (int i = 1; i <= 60; ++i) {
        const auto size = float(i);
        nested.push_back({{-size, -size, -size}, {size, -size, 0}, {0, size, size}});
    }
    const auto meshes = {shared(copies(2)), shared(copies(3)), shared(copies(50)),
                         triangles(nested)};
    for (const auto& mesh : meshes) {
        for (const unsigned branching : {2U, 4U, 8U}) {
            const Bvh bvh = with_smallest_leaves(mesh, branching);
            const double expected = brute_epo(bvh, {});
            EXPECT_NEAR(epo(bvh), expected, 1e-11 * expected);
        }
    }
}

TEST(EndPointOverlap, TakesManyTrianglesInOnePlace) {  // quadratic, were each pair looked at
    const auto mesh = shared(copies(100000));
    const Bvh bvh = with_smallest_leaves(mesh, 2);
    const Stopwatch watch;
    // Of n triangles, each is in all leaves but its own, and in all interior nodes but a few.
    const double others = double(mesh->size() - 1), overlap = epo(bvh);
    EXPECT_LT(overlap, 2.0 * others + 3.0 * others);
    EXPECT_GT(overlap, 2.0 * others + 3.0 * (others - 20.0));
    EXPECT_LT(watch.seconds(), 30.0);  // looking at each pair takes many minutes
}

}  // namespace
}  // namespace bvhlab
