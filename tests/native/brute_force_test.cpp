// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/brute_force.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <thread>
#include <vector>

#include "base/exact_sum.h"
#include "base/parallel.h"
#include "meshes.h"
#include "reference/exact_hit.h"

namespace bvhlab {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

/// The answer to one ray.
struct Answer {
    HitOf<double> hit;
    bool occluded;
};

Answer shoot(const Mesh& mesh, const Ray& ray) {
    Token token;
    const RayBatch rays{{&ray.origin, 1}, {&ray.direction, 1}, {&ray.t_min, 1}, {&ray.t_max, 1}};
    const HitsOf<double> closest = brute_force(mesh, rays, false, 1, token);
    const HitsOf<double> any = brute_force(mesh, rays, true, 1, token);
    EXPECT_TRUE(any.t.empty());
    EXPECT_EQ(any.occluded[0], closest.occluded[0]);
    return {{closest.t[0], closest.u[0], closest.v[0], closest.triangle[0]}, any.occluded[0] != 0};
}

Answer shoot(const Mesh& mesh, glm::vec3 origin, glm::vec3 direction, float t_min = 0.0F,
             float t_max = infinity) {
    return shoot(mesh, Ray{origin, t_min, direction, t_max});
}

void expect_miss(const Answer& answer) {
    EXPECT_FALSE(answer.occluded);
    EXPECT_EQ(answer.hit.triangle, no_triangle);
    EXPECT_EQ(answer.hit.t, infinity);
    EXPECT_EQ(answer.hit.u, 0.0);
    EXPECT_EQ(answer.hit.v, 0.0);
}

/// The unit square at z = 0, split along the diagonal from (0, 0) to (1, 1).
Mesh unit_square() {
    return make_mesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}});
}

TEST(ExactSum, CancelsWithoutRounding) {
    ExactSum sum;
    sum.add_product(3e38F, 3e38F, 3e38F);
    sum.add_product(1e-45F, 1e-45F, -1e-45F);
    sum.add_product(-3e38F, 3e38F, 3e38F);
    EXPECT_EQ(sum.sign(), -1);
    const double tiny = double(1e-45F);
    EXPECT_EQ(sum.value(), -tiny * tiny * tiny);
    sum.add_product(1e-45F, 1e-45F, 1e-45F);
    EXPECT_EQ(sum.sign(), 0);
    EXPECT_EQ(sum.value(), 0.0);
}

TEST(ExactSum, ProductOfSums) {
    // (1 + 2^-80) (1 - 2^-80) = 1 - 2^-160
    ExactSum plus, minus, product;
    plus.add(1.0);
    plus.add(0x1p-80);
    minus.add(1.0);
    minus.add(-0x1p-80);
    product.add_product(plus, minus);
    product.add(-1.0);
    EXPECT_EQ(product.value(), -0x1p-160);
}

TEST(BruteForce, HitsInsideWithKnownCoordinates) {
    const Mesh mesh = make_mesh({{1, 2, 5}, {5, 2, 5}, {1, 6, 5}}, {{0, 1, 2}});
    // u = 1/4, v = 1/2; the direction is not of unit length.
    const HitOf<double> hit = shoot(mesh, {2, 4, 1}, {0, 0, 2}).hit;
    EXPECT_EQ(hit.triangle, 0U);
    EXPECT_EQ(hit.t, 2.0);
    EXPECT_EQ(hit.u, 0.25);
    EXPECT_EQ(hit.v, 0.5);
    // From behind: two-sided.
    EXPECT_EQ(shoot(mesh, {2, 4, 9}, {0, 0, -2}).hit.t, 2.0);
    expect_miss(shoot(mesh, {2, 4, 1}, {0, 0, -2}));
    expect_miss(shoot(mesh, {4, 5, 1}, {0, 0, 2}));
}

TEST(BruteForce, IntervalIsClosed) {
    const Mesh mesh = unit_square();
    const glm::vec3 origin(0.75F, 0.25F, -3), up(0, 0, 1);
    EXPECT_TRUE(shoot(mesh, origin, up, 3.0F, 3.0F).occluded);
    EXPECT_TRUE(shoot(mesh, origin, up, 0.0F, 3.0F).occluded);
    expect_miss(shoot(mesh, origin, up, std::nextafter(3.0F, 4.0F)));
    expect_miss(shoot(mesh, origin, up, 0.0F, std::nextafter(3.0F, 2.0F)));
    expect_miss(shoot(mesh, origin, up, 4.0F, 2.0F));
    // An origin on the triangle is at t = 0.
    EXPECT_EQ(shoot(mesh, {0.75F, 0.25F, 0}, up).hit.t, 0.0);
}

TEST(BruteForce, EdgesAndCornersAreInside) {
    const Mesh mesh = unit_square();
    for (const float x : {0.0F, 0.25F, 1.0F})
        for (const float y : {0.0F, 0.25F, 1.0F})
            EXPECT_TRUE(shoot(mesh, {x, y, 1}, {0, 0, -1}).occluded) << x << " " << y;
    for (const float outside : {std::nextafter(0.0F, -1.0F), std::nextafter(1.0F, 2.0F)}) {
        expect_miss(shoot(mesh, {outside, 0.25F, 1}, {0, 0, -1}));
        expect_miss(shoot(mesh, {0.25F, outside, 1}, {0, 0, -1}));
    }
}

TEST(BruteForce, SharedEdgeGoesToTheLowerTriangle) {
    const Mesh mesh = unit_square();
    const glm::vec3 on_edge(0.375F, 0.375F, 0.0F);
    // Every difference is exact here, so that the line does meet the edge.
    for (const glm::vec3 offset : {glm::vec3(0.5F, -0.25F, 2), glm::vec3(-0.25F, 0.5F, -1)})
        EXPECT_EQ(shoot(mesh, on_edge + offset, -offset).hit.triangle, 0U);
}

TEST(BruteForce, TiesGoToTheLowerTriangle) {
    EXPECT_EQ(shoot(test::copies(70), {0.25F, 0.25F, 1}, {0, 0, -1}).hit.triangle, 0U);
}

/// A whole number in [-bound, bound].
float whole(std::mt19937& random, int bound) {
    return float(int(random() % std::uint32_t(2 * bound + 1)) - bound);
}

glm::vec3 whole_vector(std::mt19937& random, int bound) {
    const float x = whole(random, bound), y = whole(random, bound);
    return {x, y, whole(random, bound)};
}

TEST(BruteForce, TiesThatDoubleCannotTell) {
    // One plane by two triangles: t is equal in real arithmetic, but not always after rounding.
    std::mt19937 random(12);
    for (int i = 0; i < 200; ++i) {
        const glm::vec3 a = whole_vector(random, 1 << 20);
        const glm::vec3 p = whole_vector(random, 1 << 20), q = whole_vector(random, 1 << 20);
        const Array<glm::vec3> corners = {a, a + p, a + q, a + 3.0F * p, a + 3.0F * q};
        const glm::vec3 origin = whole_vector(random, 1 << 20);
        const glm::vec3 direction = a + glm::floor(0.3F * (p + q)) - origin;
        const Answer large_first =
            shoot(make_mesh(corners, {{0, 3, 4}, {0, 1, 2}}), origin, direction);
        const Answer small_first =
            shoot(make_mesh(corners, {{2, 0, 1}, {4, 0, 3}}), origin, direction);
        EXPECT_EQ(large_first.hit.triangle, 0U);
        EXPECT_EQ(small_first.hit.triangle, 0U);
    }
}

TEST(BruteForce, IntervalIsExact) {
    std::mt19937 random(11);
    for (int i = 0; i < 200; ++i) {
        const glm::vec3 corner = whole_vector(random, 1 << 20);
        const glm::vec3 direction = whole_vector(random, 1 << 20);
        const Mesh mesh = make_mesh({corner, corner + whole_vector(random, 1 << 20),
                                     corner + whole_vector(random, 1 << 20)},
                                    {{0, 1, 2}});
        // Whole numbers below 2^24 are exact: the ray meets the corner at t = 3 and nowhere near.
        const glm::vec3 origin = corner - 3.0F * direction;
        EXPECT_TRUE(shoot(mesh, origin, direction, 3.0F, 3.0F).occluded);
        EXPECT_FALSE(shoot(mesh, origin, direction, 0.0F, std::nextafter(3.0F, 0.0F)).occluded);
        EXPECT_FALSE(shoot(mesh, origin, direction, std::nextafter(3.0F, 4.0F)).occluded);
    }
}

/// Three whole vectors below 2^22 with determinant 1: a product of row additions.
struct Unimodular {
    glm::vec3 rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

    explicit Unimodular(std::mt19937& random) {
        const auto size = [](glm::vec3 v) { return glm::dot(glm::abs(v), glm::vec3(1)); };
        for (int tries = 0; tries < 400; ++tries) {
            const std::uint32_t from = random() % 3, to = (from + 1 + random() % 2) % 3;
            const glm::vec3 sum = rows[to] + whole(random, 3) * rows[from];
            if (size(sum) < float(1 << 22)) rows[to] = sum;
        }
    }
};

TEST(BruteForce, SignsThatDoubleCannotTell) {
    // The volumes are 1 or -1 while their terms are about 2^60: double alone would guess.
    std::mt19937 random(13);
    for (int i = 0; i < 200; ++i) {
        const auto& [direction, b, c] = Unimodular(random).rows;
        const auto meets = [&, d = direction, b = b, c = c](glm::vec3 across) {
            return shoot(make_mesh({d + across, b, c}, {{0, 1, 2}}), glm::vec3(0), d).occluded;
        };
        EXPECT_TRUE(meets(-b - c));
        EXPECT_FALSE(meets(c - b));
        EXPECT_FALSE(meets(b - c));
    }
}

TEST(BruteForce, NothingHitsATriangleWithoutArea) {
    const Mesh segment = make_mesh({{0, 0, 0}, {1, 1, 1}, {3, 3, 3}}, {{0, 1, 2}, {1, 1, 2}});
    const Mesh point = make_mesh({{1, 1, 1}}, {{0, 0, 0}});
    for (const Mesh& mesh : {segment, point}) {
        expect_miss(shoot(mesh, {0, 0, 0}, {1, 1, 1}));
        expect_miss(shoot(mesh, {1, 1, -1}, {0, 0, 1}));
    }
}

TEST(BruteForce, NothingHitsATriangleEdgeOn) {
    expect_miss(shoot(unit_square(), {-1, 0.5F, 0}, {1, 0, 0}));
    expect_miss(shoot(unit_square(), {0.5F, 0.25F, 0}, {1, 0.5F, 0}));
}

TEST(BruteForce, ClosedMeshHasNoGaps) {
    const Mesh mesh = test::sphere(12, {0.3F, -0.2F, 0.7F}, 1.1F);
    const glm::vec3 inside(0.31F, -0.17F, 0.72F);
    const auto expect_closed = [&](glm::vec3 target) {
        EXPECT_TRUE(shoot(mesh, inside, target - inside).occluded);
    };
    for (const glm::uvec3& triangle : mesh.triangles) {
        const glm::vec3 a = mesh.vertices[triangle.x], b = mesh.vertices[triangle.y];
        expect_closed(a);
        expect_closed((a + b) * 0.5F);
        expect_closed(a + (b - a) * 0.3F);
    }
}

TEST(BruteForce, SphereIsWhereTheFormulaSays) {
    const Mesh mesh = test::sphere(100);
    std::mt19937 random(3);
    for (int i = 0; i < 50; ++i) {
        const glm::vec3 origin = glm::normalize(test::uniform_vector(random, -1, 1)) * 3.0F;
        const glm::vec3 target = test::uniform_vector(random, -0.4F, 0.4F);
        const glm::dvec3 o(origin), d = glm::normalize(glm::dvec3(target - origin));
        const double b = glm::dot(o, d);
        const double expected = -b - std::sqrt(b * b - glm::dot(o, o) + 1.0);
        EXPECT_NEAR(shoot(mesh, origin, glm::vec3(d)).hit.t, expected, 2e-3);
    }
}

TEST(BruteForce, ScaleDoesNotMatter) {
    for (const float scale : {1e-38F, 1e-30F, 1e-10F, 1e10F, 1e30F, 1e36F}) {
        const Mesh mesh = make_mesh({{0, 0, 0}, {scale, 0, 0}, {0, scale, 0}}, {{0, 1, 2}});
        const glm::vec3 origin(0.25F * scale, 0.5F * scale, -scale);
        EXPECT_NEAR(shoot(mesh, origin, {0, 0, scale}).hit.t, 1.0, 1e-6) << scale;
        EXPECT_NEAR(shoot(mesh, origin, {0, 0, 1}).hit.t / double(scale), 1.0, 1e-6) << scale;
        expect_miss(shoot(mesh, origin + glm::vec3(0.5F * scale, 0, 0), {0, 0, 1}));
    }
}

TEST(BruteForce, FarOriginsAndSmallTriangles) {
    const Mesh mesh = make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
    EXPECT_TRUE(shoot(mesh, {0.25F, 0.25F, -3e38F}, {0, 0, 1}).occluded);
    EXPECT_TRUE(shoot(mesh, {0.25F, 0.25F, -1e20F}, {0, 0, 1e-30F}).occluded);
    // Off by one unit in the last place of the edge, from as far as float reaches.
    expect_miss(shoot(mesh, {std::nextafter(0.0F, -1.0F), 0.25F, -3e38F}, {0, 0, 1}));
}

/// The filter must never lose a hit: every triangle against every ray, without it.
TEST(BruteForce, FilterLosesNothing) {
    std::mt19937 random(5);
    const Mesh small = test::random_soup(3000, 0.2F);
    for (const glm::vec3 shift : {glm::vec3(0), glm::vec3(1000, -2000, 500)}) {
        Array<glm::vec3> vertices = small.vertices;
        for (glm::vec3& vertex : vertices) vertex += shift;
        const Mesh mesh = make_mesh(std::move(vertices), small.triangles);
        for (int i = 0; i < 200; ++i) {
            const Ray ray{shift + test::uniform_vector(random, -1, 2), 0.0F,
                          test::uniform_vector(random, -1, 1), infinity};
            std::uint32_t expected = no_triangle;
            Crossing nearest;
            for (std::uint32_t t = 0; t < mesh.size(); ++t) {
                if (!line_meets(ray, mesh.triangle(t))) continue;
                Crossing found = crossing(ray, mesh.triangle(t));
                if (!in_interval(found, ray)) continue;
                if (expected != no_triangle && !nearer(found, nearest)) continue;
                nearest = found;
                expected = t;
            }
            EXPECT_EQ(shoot(mesh, ray).hit.triangle, expected);
        }
    }
}

/// Rays across the tips of needles far from the origin touch the filter's spheres from outside.
TEST(BruteForce, FilterLosesNoTip) {
    std::mt19937 random(7);
    int hits = 0;
    for (int i = 0; i < 3000; ++i) {
        const glm::vec3 along(test::uniform(random, -1, 1), 0, test::uniform(random, -1, 1));
        const glm::vec3 needle(-along.z, 0, along.x);
        const glm::vec3 middle = test::uniform_vector(random, -1e4F, 1e4F);
        const glm::vec3 tip = middle + needle;
        const Mesh mesh = make_mesh(
            {tip, middle - needle, middle + along * 0.001F + glm::vec3(0, 0.01F, 0)}, {{0, 1, 2}});
        const Ray ray{tip - along * test::uniform(random, 0, 3), 0.0F, along, infinity};
        const bool expected =
            line_meets(ray, mesh.triangle(0)) && in_interval(crossing(ray, mesh.triangle(0)), ray);
        hits += expected;
        EXPECT_EQ(shoot(mesh, ray).occluded, expected);
    }
    EXPECT_GT(hits, 100);
}

/// Rays of one batch, with a single interval.
struct Rays {
    std::vector<glm::vec3> origins, directions;
    float t_min = 0.0F, t_max = infinity;

    RayBatch batch() const { return {origins, directions, {&t_min, 1}, {&t_max, 1}}; }
};

Rays random_rays(std::size_t count) {
    std::mt19937 random(9);
    Rays rays;
    for (std::size_t i = 0; i < count; ++i) {
        rays.origins.push_back(test::uniform_vector(random, 0, 1));
        rays.directions.push_back(test::uniform_vector(random, -1, 1));
    }
    return rays;
}

TEST(BruteForce, SameAnswerFromAnyNumberOfThreads) {
    const Mesh mesh = test::random_soup(5000);
    const Rays rays = random_rays(333);
    Token token;
    const HitsOf<double> one = brute_force(mesh, rays.batch(), false, 1, token);
    const HitsOf<double> two = brute_force(mesh, rays.batch(), false, 2, token);
    EXPECT_EQ(one.triangle, two.triangle);
    EXPECT_EQ(one.t, two.t);
    EXPECT_EQ(one.u, two.u);
    EXPECT_EQ(one.v, two.v);
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
}

TEST(BruteForce, NoRays) {
    Token token;
    EXPECT_TRUE(brute_force(unit_square(), Rays{}.batch(), false, 0, token).t.empty());
}

TEST(BruteForce, StopsSoonAfterCancel) {
    const Mesh mesh = test::random_soup(200000, 0.02F);
    const Rays rays = random_rays(20000);
    Token token;
    Stopwatch since_cancel;
    std::jthread canceller([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        since_cancel = Stopwatch();
        token.cancel();
    });
    EXPECT_THROW(brute_force(mesh, rays.batch(), false, 2, token), Cancelled);
    EXPECT_LT(since_cancel.seconds(), 2.0);  // all of it takes several times as long
}

}  // namespace
}  // namespace bvhlab
