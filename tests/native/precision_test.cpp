// SPDX-License-Identifier: GPL-3.0-or-later
// The triangle and box tests that tracing can be asked for, each by itself and against the judge.
#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <hwy/targets.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <thread>
#include <vector>

#include "build/lbvh.h"
#include "bvh/collapse.h"
#include "meshes.h"
#include "reference/brute_force.h"
#include "trace/trace.h"
#include "trace/transforms.h"

namespace bvhlab {
namespace {

using namespace test;
constexpr float infinity = std::numeric_limits<float>::infinity();

struct Rays {
    std::vector<glm::vec3> origins, directions;
    std::vector<float> t_min{0.0F}, t_max{infinity};

    RayBatch batch() const { return {origins, directions, t_min, t_max}; }
    void add(glm::vec3 origin, glm::vec3 direction) {
        origins.push_back(origin);
        directions.push_back(direction);
    }
};

std::vector<TraceOptions> all_choices() {
    std::vector<TraceOptions> choices;
    for (std::size_t test = 0; test < triangle_test_names.size(); ++test)
        for (std::size_t box = 0; box < box_test_names.size(); ++box)
            choices.push_back({.triangle_test = TriangleTest(test), .box_test = BoxTest(box)});
    return choices;
}

std::string name(const TraceOptions& options) {
    return std::string(triangle_test_names[std::size_t(options.triangle_test)]) + ", " +
           box_test_names[std::size_t(options.box_test)];
}

/// Trees of every layout and branching factor.
std::vector<Bvh> all_trees(const std::shared_ptr<const Mesh>& mesh) {
    Token token;
    const BinaryBvh binary = build_lbvh(*mesh, token);
    std::vector<Bvh> trees;
    for (const unsigned k : {2U, 4U, 8U}) trees.push_back(collapse(binary, mesh, k, {}, token));
    trees.push_back(compress(binary, mesh, {}, token));
    return trees;
}

Hits hits_of(const Bvh& bvh, const Rays& rays, const TraceOptions& options) {
    Token token;
    return trace(bvh, rays.batch(), options, token);
}

/// Axes turned: (x, y, z) to (z, x, y), `turns` times.
glm::vec3 turned(glm::vec3 v, int turns) {
    for (; turns > 0; --turns) v = {v.z, v.x, v.y};
    return v;
}

TEST(Precision, NamesAreChecked) {
    EXPECT_EQ(triangle_test_named("woop_affine"), TriangleTest::woop_affine);
    EXPECT_EQ(box_test_named("plain"), BoxTest::plain);
    try {
        triangle_test_named("woop");
        FAIL();
    } catch (const std::invalid_argument& error) {
        EXPECT_STREQ(error.what(),
                     "unknown triangle test 'woop'; there are: watertight, moller_trumbore, "
                     "woop_affine, baldwin_weber");
    }
    EXPECT_THROW(box_test_named(""), std::invalid_argument);
}

/// Every number in these is a sum of few powers of two, so every formula gives the exact answer,
/// whichever axis the triangle faces and whichever way it is wound.
TEST(Precision, ClosedFormHits) {
    for (int turns = 0; turns < 3; ++turns) {
        for (const bool wound : {false, true}) {
            const glm::vec3 b = turned({3, 2, 3}, turns), c = turned({1, 6, 3}, turns);
            const auto mesh = shared(make_mesh(
                {turned({1, 2, 3}, turns), wound ? c : b, wound ? b : c}, {glm::uvec3(0, 1, 2)}));
            Rays rays;
            rays.add(turned({1.5F, 3, 7}, turns), turned({0, 0, -2}, turns));  // u = v = 1/4
            rays.add(turned({2, 3.5F, 1}, turns), turned({-0.125F, 0, 0.5F}, turns));  // aslant
            rays.add(turned({1, 2, 7}, turns), turned({0, 0, -1}, turns));             // corner a
            rays.add(turned({2, 4, 7}, turns), turned({0, 0, -1}, turns));             // edge b c
            rays.add(turned({3, 6, 7}, turns), turned({0, 0, -1}, turns));             // beside
            rays.add(turned({1.5F, 3, 7}, turns), turned({0, 0, 1}, turns));           // away
            rays.add(turned({0, 3, 3}, turns), turned({1, 0, 0}, turns));  // in the plane
            for (const Bvh& bvh : all_trees(mesh)) {
                for (const TraceOptions& choice : all_choices()) {
                    const Hits hits = hits_of(bvh, rays, choice);
                    const std::string what = name(choice);
                    const Array<std::uint8_t> met{1, 1, 1, 1, 0, 0, 0};
                    EXPECT_EQ(hits.occluded, met) << what;
                    EXPECT_EQ(hits.t, (Array<float>{2, 4, 4, 4, infinity, infinity, infinity}))
                        << what;
                    const Array<float> first{0.25F, 0.25F, 0, 0.5F, 0, 0, 0};
                    const Array<float> second{0.25F, 0.375F, 0, 0.5F, 0, 0, 0};
                    EXPECT_EQ(hits.u, wound ? second : first) << what;
                    EXPECT_EQ(hits.v, wound ? first : second) << what;
                    TraceOptions any = choice;
                    any.any_hit = true;
                    EXPECT_EQ(hits_of(bvh, rays, any).occluded, met) << what;
                }
            }
        }
    }
}

TEST(Precision, IntervalIsClosedAndTiesGoToTheLowerTriangle) {
    const auto mesh = shared(copies(100));
    for (const Bvh& bvh : all_trees(mesh)) {
        for (const TraceOptions& choice : all_choices()) {
            const auto between = [&](float t_min, float t_max) {
                Rays rays;
                rays.add({0.25F, 0.25F, 2.0F}, {0.0F, 0.0F, -4.0F});  // t = 0.5
                rays.t_min = {t_min};
                rays.t_max = {t_max};
                return hits_of(bvh, rays, choice).triangle[0];
            };
            EXPECT_EQ(between(0.0F, infinity), 0U) << name(choice);
            EXPECT_EQ(between(0.5F, 0.5F), 0U) << name(choice);
            EXPECT_EQ(between(0.0F, std::nextafter(0.5F, 0.0F)), no_triangle) << name(choice);
            EXPECT_EQ(between(std::nextafter(0.5F, 1.0F), infinity), no_triangle) << name(choice);
            EXPECT_EQ(between(1.0F, 0.0F), no_triangle) << name(choice);
        }
    }
}

/// Away from edges every test finds the judge's triangle. In the unit cube, with triangles of
/// edges up to 0.2 whose plane the ray meets at no grazing angle, t errs by a few roundings of
/// coordinates of at most 2, magnified by 1 / cos <= 8: below 2^-17.
TEST(Precision, AgreesWithTheJudgeAwayFromEdges) {
    Token token;
    const auto mesh = shared(random_soup(1500, 0.2F));
    std::mt19937 random(7);
    Rays rays;
    while (rays.origins.size() < 2000) {
        const glm::vec3 origin = uniform_vector(random, -0.2F, 1.2F);
        rays.add(origin, glm::normalize(uniform_vector(random, 0.0F, 1.0F) - origin));
    }
    const HitsOf<double> judge = brute_force(*mesh, rays.batch(), false, 0, token);
    const auto is_clear = [&](std::size_t i) {
        if (!judge.occluded[i]) return false;
        const Triangle triangle = mesh->triangle(judge.triangle[i]);
        const glm::vec3 normal = glm::cross(triangle.b - triangle.a, triangle.c - triangle.a);
        const float area = glm::length(normal);
        return std::min({judge.u[i], judge.v[i], 1.0 - judge.u[i] - judge.v[i]}) > 0.01 &&
               area > 1e-3F && std::abs(glm::dot(normal, rays.directions[i])) > 0.125F * area;
    };
    for (const Bvh& bvh : all_trees(mesh)) {
        for (const TraceOptions& choice : all_choices()) {
            const Hits hits = hits_of(bvh, rays, choice);
            std::size_t clear = 0, wrong = 0;
            for (std::size_t i = 0; i < rays.origins.size(); ++i) {
                if (!is_clear(i)) continue;
                ++clear;
                // Another triangle can only come in between beside an edge of its own.
                if (hits.triangle[i] != judge.triangle[i]) {
                    ++wrong;
                    continue;
                }
                EXPECT_NEAR(hits.t[i], judge.t[i], 0x1p-17) << name(choice);
                EXPECT_NEAR(hits.u[i], judge.u[i], 1e-3) << name(choice);
                EXPECT_NEAR(hits.v[i], judge.v[i], 1e-3) << name(choice);
            }
            EXPECT_GT(clear, 500U);
            EXPECT_EQ(wrong, 0U) << name(choice);
        }
    }
}

/// Nothing is fused and no order of sums depends on the target, so even the tests in float give the
/// same bits from every instruction set, thread count and order.
TEST(Precision, SameBitsFromEveryInstructionSet) {
    const auto mesh = shared(random_soup(800, 0.3F));
    std::mt19937 random(5);
    Rays rays;
    for (int i = 0; i < 500; ++i)
        rays.add(uniform_vector(random, -0.2F, 1.2F), uniform_vector(random, -1.0F, 1.0F));
    for (const Bvh& bvh : all_trees(mesh)) {
        for (TraceOptions choice : all_choices()) {
            const Hits expected = hits_of(bvh, rays, choice);
            choice.threads = 3;
            choice.reorder = Reorder::aila;
            for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
                hwy::SetSupportedTargetsForTest(target);
                const Hits hits = hits_of(bvh, rays, choice);
                hwy::SetSupportedTargetsForTest(0);
                EXPECT_EQ(hits.triangle, expected.triangle)
                    << name(choice) << ", " << hwy::TargetName(target) << ", layout "
                    << int(bvh.layout());
                EXPECT_EQ(hits.t, expected.t) << name(choice);
                EXPECT_EQ(hits.u, expected.u) << name(choice);
                EXPECT_EQ(hits.v, expected.v) << name(choice);
            }
        }
    }
}

/// What the comparison is about: rays aimed at inner vertices of a flat grid must hit it. The
/// default does with every ray, whichever tree; plain boxes alone lose some, float triangle tests
/// more.
TEST(Precision, OnlyTheDefaultIsWatertightOnAGrid) {
    constexpr int side = 16;
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (int x = 0; x <= side; ++x)
        for (int y = 0; y <= side; ++y)
            vertices.push_back({0.1F + 0.1F * float(x), 0.2F + 0.1F * float(y), 0.3F});
    for (std::uint32_t x = 0; x < side; ++x) {
        for (std::uint32_t y = 0; y < side; ++y) {
            const std::uint32_t at = x * (side + 1) + y, next = at + side + 1;
            triangles.push_back({at, next, next + 1});
            triangles.push_back({at, next + 1, at + 1});
        }
    }
    const auto mesh = shared(make_mesh(Array<glm::vec3>(vertices), std::move(triangles)));
    std::mt19937 random(1);
    Rays rays;
    for (int x = 1; x < side; ++x) {
        for (int y = 1; y < side; ++y) {
            const glm::vec3 target = vertices[std::size_t(x * (side + 1) + y)];
            for (int i = 0; i < 30; ++i) {
                const glm::vec3 from =
                    target + uniform_vector(random, -1.0F, 1.0F) + glm::vec3(0, 0, 3);
                rays.add(from, target - from);
            }
            rays.add(target + glm::vec3(0, 0, 5), {0, 0, -1});
        }
    }
    std::vector<std::ptrdiff_t> missed(all_choices().size(), 0);
    for (const Bvh& bvh : all_trees(mesh))
        for (std::size_t i = 0; i < missed.size(); ++i)
            missed[i] += std::ranges::count(hits_of(bvh, rays, all_choices()[i]).occluded, 0);
    EXPECT_EQ(missed[0], 0) << "the default";
    EXPECT_GT(missed[1], 0) << "plain boxes are believed to miss here";
    EXPECT_GT(missed[2], 0) << "Moeller and Trumbore is believed to miss here";
    EXPECT_GT(missed[4], 0) << "Woop's affine test is believed to miss here";
}

TEST(Precision, TrianglesWithoutAreaAreNeverHit) {
    const auto mesh = shared(
        make_mesh({{1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {0, 0, 0}, {1e-40F, 0, 0}, {0, 1e-40F, 0}},
                  {glm::uvec3(0, 1, 2), {0, 0, 0}, {1, 1, 2}, {2, 1, 2}, {3, 4, 5}}));
    Rays rays;
    rays.add({1, 1, 3}, {0, 0, -1});
    rays.add({0.5F, 0.5F, 0.5F}, {1, 1, 1});
    rays.add({1, 1, 1}, {1, 1, 1});
    rays.add({0, 0, 1}, {0, 0, -1});
    for (const Bvh& bvh : all_trees(mesh)) {
        for (const TraceOptions& choice : all_choices()) {
            const Hits hits = hits_of(bvh, rays, choice);
            for (std::size_t i = 0; i < 3; ++i)
                EXPECT_TRUE(hits.triangle[i] == no_triangle) << name(choice) << ", ray " << i;
            // The last triangle has an area, but its transform is beyond float.
            EXPECT_TRUE(hits.triangle[3] == no_triangle || hits.triangle[3] == 4) << name(choice);
        }
    }
}

/// The largest and smallest numbers and rays in the planes of boxes end in some answer, and one
/// that names a triangle there is.
TEST(Precision, HardNumbersEndInAnAnswer) {
    const float parts[] = {0.0F, -0.0F, 1.0F, -1e-42F, 1e-30F, -3e38F};
    for (Mesh& mesh : std::vector<Mesh>{sphere(6), sphere(6, {}, 1e-38F), sphere(6, {}, 9e36F),
                                        growing_chain(200, 1.2), copies(40)}) {
        const auto held = shared(std::move(mesh));
        Rays rays;
        for (std::size_t i = 0; i < 3; ++i)
            for (const float x : parts)
                for (const float y : parts)
                    for (const float z : parts)
                        if (x != 0.0F || y != 0.0F || z != 0.0F)
                            rays.add(held->triangle(i).a, {x, y, z});
        for (const Bvh& bvh : all_trees(held)) {
            for (const TraceOptions& choice : all_choices()) {
                const Hits hits = hits_of(bvh, rays, choice);
                for (std::size_t i = 0; i < hits.t.size(); ++i) {
                    ASSERT_TRUE(hits.triangle[i] < held->size() || hits.triangle[i] == no_triangle);
                    ASSERT_FALSE(std::isnan(hits.t[i]) || std::isnan(hits.u[i]) ||
                                 std::isnan(hits.v[i]));
                }
            }
        }
    }
}

TEST(Precision, TransformsAreMadeOnceAndMapTheCorners) {
    Token token;
    const auto mesh = shared(random_soup(300, 0.5F));
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 8, {}, token);
    EXPECT_EQ(triangle_transforms(bvh, TriangleTest::watertight, token), nullptr);
    EXPECT_EQ(triangle_transforms(bvh, TriangleTest::moller_trumbore, token), nullptr);
    std::shared_ptr<const TriangleTransforms> made[4];
    std::vector<std::thread> threads;
    for (auto& mine : made)
        threads.emplace_back(
            [&] { mine = triangle_transforms(bvh, TriangleTest::woop_affine, token); });
    for (std::thread& thread : threads) thread.join();
    for (const auto& mine : made) EXPECT_EQ(mine, made[0]);
    const Rays rays{{glm::vec3(0)}, {glm::vec3(1)}};
    EXPECT_EQ(hits_of(bvh, rays, {.triangle_test = TriangleTest::woop_affine}).prepared_bytes,
              made[0]->bytes());
    EXPECT_EQ(hits_of(bvh, rays, {}).prepared_bytes, 0U);

    const auto& tree = std::get<WideBvh<8>>(bvh.tree);
    for (std::size_t block = 0; block < tree.blocks.size(); ++block) {
        for (std::size_t lane = 0; lane < 8; ++lane) {
            const std::uint32_t index = tree.blocks[block].triangle[lane];
            if (index == no_triangle) continue;
            const auto row = [&](std::size_t r, const glm::vec3& p) {
                const auto value = [&](std::size_t k) {
                    return double(made[0]->values[(block * 12 + 4 * r + k) * 8 + lane]);
                };
                return value(0) * p.x + value(1) * p.y + value(2) * p.z + value(3);
            };
            const Triangle triangle = mesh->triangle(index);
            const glm::vec3 corners[3] = {triangle.a, triangle.b, triangle.c};
            for (int corner = 0; corner < 3; ++corner) {
                double scale = 0.0;  // of the coefficients, whose rounding is the error
                for (std::size_t k = 0; k < 12; ++k)
                    scale = std::max(
                        scale, std::abs(double(made[0]->values[(block * 12 + k) * 8 + lane])));
                const double error = 8.0 * 0x1p-24 * scale;
                EXPECT_NEAR(row(0, corners[corner]), 0.0, error);
                EXPECT_NEAR(row(1, corners[corner]), corner == 1, error);
                EXPECT_NEAR(row(2, corners[corner]), corner == 2, error);
            }
        }
    }
}

}  // namespace
}  // namespace bvhlab
