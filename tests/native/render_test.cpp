// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of rendering, each against its closed form: sampler, shapes, ray offset.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <set>

#include "meshes.h"
#include "render/offset.h"
#include "render/sample_shapes.h"
#include "render/sampler.h"
#include "trace/intersect.h"

namespace bvhlab {
namespace {

// --- sampler -------------------------------------------------------------------------------------

TEST(Sampler, SecondSobolDimensionFollowsItsDirectionNumbers) {
    for (std::uint32_t index : {0U, 1U, 2U, 3U, 5U, 77U, 0x12345678U, 0xFFFFFFFFU}) {
        std::uint32_t expected = 0, direction = 0x80000000U;
        for (std::uint32_t bits = index; bits; bits >>= 1) {
            if (bits & 1U) expected ^= direction;
            direction ^= direction >> 1;
        }
        EXPECT_EQ(sobol_second(index), expected) << index;
    }
}

TEST(Sampler, EveryElementaryIntervalHoldsOneOfTheFirst64Samples) {
    for (std::uint32_t pixel : {0U, 1U, 4711U})
        for (std::uint32_t dimension : {0U, 1U, 9U})
            for (int columns = 1; columns <= 64; columns *= 2) {
                const int rows = 64 / columns;
                std::set<int> cells;
                for (std::uint32_t sample = 0; sample < 64; ++sample) {
                    const glm::dvec2 point = Sampler(pixel, sample, 7).pair(dimension);
                    cells.insert(int(point.x * columns) * rows + int(point.y * rows));
                }
                EXPECT_EQ(cells.size(), 64U) << columns << " columns";
            }
}

TEST(Sampler, PixelsDimensionsAndSeedsAreIndependent) {
    const auto correlation = [](auto&& first, auto&& second) {
        double sum = 0.0;
        for (std::uint32_t i = 0; i < 4096; ++i) sum += (first(i) - 0.5) * (second(i) - 0.5);
        return sum / 4096.0 * 12.0;
    };
    const auto base = [](std::uint32_t i) { return Sampler(i, 3, 0).pair(1).x; };
    EXPECT_NEAR(correlation(base, base), 1.0, 0.05);
    EXPECT_NEAR(correlation(base, [](auto i) { return Sampler(i, 3, 0).pair(1).y; }), 0, 0.06);
    EXPECT_NEAR(correlation(base, [](auto i) { return Sampler(i, 3, 0).pair(2).x; }), 0, 0.06);
    EXPECT_NEAR(correlation(base, [](auto i) { return Sampler(i, 3, 1).pair(1).x; }), 0, 0.06);
    EXPECT_NEAR(correlation(base, [](auto i) { return Sampler(i + 1, 3, 0).pair(1).x; }), 0, 0.06);
    EXPECT_NEAR(correlation(base, [](auto i) { return Sampler(i, 4, 0).pair(1).x; }), 0, 0.06);
}

TEST(SampleShapes, CosineDirectionsHaveTheirMoments) {
    const glm::dvec3 normal = glm::normalize(glm::dvec3(0.3, -0.5, -0.8));
    glm::dvec3 mean(0.0);
    constexpr std::uint32_t count = 4096;
    for (std::uint32_t i = 0; i < count; ++i) {
        const glm::dvec3 direction = sample_cosine(normal, Sampler(0, i, 0).pair(0));
        EXPECT_NEAR(glm::length(direction), 1.0, 1e-12);
        EXPECT_GE(glm::dot(direction, normal), 0.0);
        mean += direction / double(count);
    }
    EXPECT_NEAR(glm::length(mean - normal * (2.0 / 3.0)), 0.0, 1e-3);
}

TEST(SampleShapes, BasisIsOrthonormalEverywhere) {
    for (const glm::dvec3& axis : {glm::dvec3(0, 0, 1), glm::dvec3(0, 0, -1), glm::dvec3(1, 0, 0),
                                   glm::normalize(glm::dvec3(1e-9, -1e-9, -1))}) {
        const glm::dmat3 basis = basis_about(axis);
        EXPECT_NEAR(glm::determinant(basis), 1.0, 1e-12);
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(glm::length(basis[i]), 1.0, 1e-12);
        EXPECT_EQ(basis[2], axis);
    }
}

// --- offset --------------------------------------------------------------------------------------

/// Single-precision test after Möller & Trumbore 1997, as other tracers of the same rays may use
/// it.
bool meets_in_float(const Triangle& triangle, const Ray& ray) {
    const glm::vec3 side = triangle.b - triangle.a, other = triangle.c - triangle.a;
    const glm::vec3 p = glm::cross(ray.direction, other);
    const float inverse = 1.0F / glm::dot(side, p);
    const glm::vec3 from = ray.origin - triangle.a;
    const float u = glm::dot(from, p) * inverse;
    const glm::vec3 q = glm::cross(from, side);
    const float v = glm::dot(ray.direction, q) * inverse;
    const float t = glm::dot(other, q) * inverse;
    return u >= 0.0F && v >= 0.0F && u + v <= 1.0F && t > 0.0F;
}

bool meets_in_double(const Triangle& triangle, const Ray& ray) {
    Box bounds{triangle.a, triangle.a};
    bounds.grow(triangle.b);
    bounds.grow(triangle.c);
    float corners[3][3];
    for (int axis = 0; axis < 3; ++axis) {
        corners[0][axis] = triangle.a[axis];
        corners[1][axis] = triangle.b[axis];
        corners[2][axis] = triangle.c[axis];
    }
    float t, u, v;
    return meets_triangle(PreparedRay(ray, bounds), corners, t, u, v);
}

/// Height over the longest side; slivers are no test for a single-precision tracer.
double fatness(const Triangle& triangle) {
    const glm::dvec3 a(triangle.a), b(triangle.b), c(triangle.c);
    const double longest = std::max({glm::length(b - a), glm::length(c - b), glm::length(a - c)});
    return glm::length(glm::cross(b - a, c - a)) / (longest * longest);
}

struct Placement {
    float size, distance;
};

class Offset : public testing::TestWithParam<Placement> {};

TEST_P(Offset, NewRaysNeverMeetTheirOwnTriangle) {
    const auto [size, distance] = GetParam();
    std::mt19937 random(5);
    int in_double = 0, in_float = 0, tried = 0;
    for (int i = 0; i < 20000; ++i) {
        const glm::vec3 centre = test::uniform_vector(random, -distance, distance);
        const Triangle triangle{centre + test::uniform_vector(random, -size, size),
                                centre + test::uniform_vector(random, -size, size),
                                centre + test::uniform_vector(random, -size, size)};
        if (!(fatness(triangle) > 0.05)) continue;
        double u = test::uniform(random, 0, 1), v = test::uniform(random, 0, 1);
        if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
        const glm::dvec3 incoming(test::uniform_vector(random, -1, 1));
        const SurfacePoint point = surface_point(triangle, u, v, incoming);
        // Half of the directions graze.
        glm::dvec3 direction(test::uniform_vector(random, -1, 1));
        if (i % 2) direction -= 0.999 * glm::dot(direction, point.normal) * point.normal;
        const Ray ray{offset_origin(point, direction), 0.0F, glm::vec3(direction),
                      std::numeric_limits<float>::infinity()};
        in_double += meets_in_double(triangle, ray) ? 1 : 0;
        in_float += meets_in_float(triangle, ray) ? 1 : 0;
        ++tried;
    }
    EXPECT_GT(tried, 10000);
    EXPECT_EQ(in_double, 0);
    EXPECT_EQ(in_float, 0);
}

INSTANTIATE_TEST_SUITE_P(AnyScale, Offset,
                         testing::Values(Placement{1, 0}, Placement{1, 1e3F}, Placement{100, 1e6F},
                                         Placement{1e-6F, 0}, Placement{1e-6F, 1e-4F},
                                         Placement{1e6F, 1e6F}, Placement{1e4F, 1}));

TEST(Offset, WithoutOffsetTrianglesDoMeetThemselves) {
    // What the offset is for: the rounded hit point alone is often on the wrong side.
    std::mt19937 random(5);
    int met = 0;
    for (int i = 0; i < 1000; ++i) {
        const Triangle triangle{test::uniform_vector(random, 0, 10),
                                test::uniform_vector(random, 0, 10),
                                test::uniform_vector(random, 0, 10)};
        SurfacePoint point = surface_point(triangle, 0.3, 0.3, {0, 0, -1});
        point.clearance = 0.0;
        met += meets_in_double(
            triangle, {offset_origin(point, point.normal), 0.0F, glm::vec3(point.normal), 1e30F});
    }
    EXPECT_GT(met, 100);
}

TEST(Offset, NormalFacesTheViewerAndNeedlesHaveOne) {
    const Triangle triangle{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    EXPECT_EQ(surface_point(triangle, 0.2, 0.2, {0, 0, -1}).normal, glm::dvec3(0, 0, 1));
    EXPECT_EQ(surface_point(triangle, 0.2, 0.2, {0, 0, 1}).normal, glm::dvec3(0, 0, -1));
    const Triangle needle{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
    EXPECT_EQ(surface_point(needle, 0.2, 0.2, {0, 0, 2}).normal, glm::dvec3(0, 0, -1));
}

}  // namespace
}  // namespace bvhlab
