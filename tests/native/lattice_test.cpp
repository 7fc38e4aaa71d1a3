// SPDX-License-Identifier: GPL-3.0-or-later
// Exact decisions in lattice arithmetic against those in expansions: the same bits.
#include "trace/lattice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "meshes.h"
#include "scene/exact_volume.h"
#include "trace/expanded.h"

namespace bvhlab {
namespace {

using namespace test;

struct Case {
    Ray ray;
    float corners[3][3];

    PreparedRay prepared() const {
        Box bounds{corner(0), corner(0)};
        bounds.grow(corner(1));
        bounds.grow(corner(2));
        return {ray, bounds};
    }
    glm::vec3 corner(int i) const { return {corners[i][0], corners[i][1], corners[i][2]}; }
};

float whole(std::mt19937& random, int bound) {
    return float(int(random() % std::uint32_t(2 * bound + 1)) - bound);
}

/// A coordinate of one of the kinds that decide how many bits lattice arithmetic needs.
float coordinate(std::mt19937& random, std::uint32_t kind) {
    switch (kind) {
        case 0:
            return whole(random, 4);
        case 1:
            return 0.01F * whole(random, 400);
        case 2:
            return uniform(random, -1.0F, 1.0F);
        case 3:  // some tiny, as cosines of right angles are
            return random() % 4 == 0 ? 4.37114e-8F : uniform(random, -1.0F, 1.0F);
        case 4:
            return 1e5F + uniform(random, -1.0F, 1.0F);
        default:
            return std::ldexp(uniform(random, -1.0F, 1.0F), int(random() % 120) - 60);
    }
}

/// A ray that passes a corner so closely that the edge functions there are far below what double
/// could tell, but have more bits than one.
Case passing_case(std::mt19937& random) {
    Case made;
    for (auto& corner : made.corners)
        for (float& x : corner) x = uniform(random, -1.0F, 1.0F);
    const float aside = std::ldexp(whole(random, 255), -60);
    made.ray = {{aside, 0.0F, 0.0F}, 0.0F, made.corner(0), std::numeric_limits<float>::infinity()};
    return made;
}

/// A ray at, or by rounding beside, a corner, a point of an edge or one of the inside; its interval
/// often ends there.
Case random_case(std::mt19937& random) {
    const std::uint32_t kind = random() % 7;
    if (kind == 6) return passing_case(random);
    Case made;
    for (auto& corner : made.corners)
        for (float& x : corner) x = coordinate(random, kind);
    glm::vec3 origin;
    for (int axis = 0; axis < 3; ++axis) origin[axis] = coordinate(random, kind);
    if (random() % 8 == 0) origin = made.corner(0);
    const float u = float(random() % 3) * 0.5F, v = random() % 2 ? 1.0F - u : 0.25F * (1.0F - u);
    const glm::vec3 target =
        (1.0F - u - v) * made.corner(0) + u * made.corner(1) + v * made.corner(2);
    const float scale = std::ldexp(1.0F, int(random() % 5) - 2);
    glm::vec3 direction = (target - origin) * scale;
    if (direction == glm::vec3(0.0F)) direction.x = 1.0F;
    const float t = 1.0F / scale, infinity = std::numeric_limits<float>::infinity();
    made.ray = {origin, random() % 4 == 0 ? t : 0.0F, direction, random() % 4 == 0 ? t : infinity};
    return made;
}

bool same_bits(double a, double b) {
    return std::memcmp(&a, &b, sizeof a) == 0;
}

TEST(Lattice, EdgesAreThoseOfExpansions) {
    std::mt19937 random(1);
    int fitting = 0, zeros = 0;
    for (int i = 0; i < 20000; ++i) {
        const Case given = random_case(random);
        LatticeTriangle lattice;
        if (!lattice.set(given.prepared(), given.corners)) continue;
        ++fitting;
        for (int from = 0; from < 3; ++from) {
            const int to = (from + 1) % 3;
            const Integer128 edge = lattice.edge(from, to);
            const ExactSum expected = exact_volume(given.ray.origin, given.ray.direction,
                                                   given.corner(from), given.corner(to));
            ASSERT_EQ((edge > 0) - (edge < 0), expected.sign()) << i;
            if (is_double(edge)) {
                ASSERT_EQ(double(edge) * lattice.edge_unit, expected.value()) << i;
            }
            zeros += edge == 0;
        }
    }
    EXPECT_GT(fitting, 12000);
    EXPECT_GT(zeros, 5000);
}

/// What meets_triangle goes on with.
TEST(Lattice, DecidesAsExpansionsDo) {
    std::mt19937 random(2);
    int met = 0, passed = 0, beyond_double = 0;
    for (int i = 0; i < 20000; ++i) {
        const Case given = random_case(random);
        const PreparedRay ray = given.prepared();
        EdgeFunctions edges = edge_functions(ray, given.corners);
        if (edges.pass_by() || !edges.is_vague()) continue;
        double expected[3] = {edges.a, edges.b, edges.c};
        LatticeTriangle lattice;
        const bool fits = lattice.set(ray, given.corners);
        for (int k = 0; k < 3; ++k) {  // a is that of the edge from c to b, and so on
            if (std::abs(expected[k]) > edges.bound) continue;
            const int from = (k + 2) % 3, to = (k + 1) % 3;
            expected[k] = expanded_edge_function(ray, given.corners[from], given.corners[to]);
            beyond_double += fits && !is_double(lattice.edge(from, to));
        }
        const auto [least, most] = std::minmax({expected[0], expected[1], expected[2]});
        const bool same_signs = least >= 0.0 || most <= 0.0;
        ASSERT_EQ(decide_edges(ray, given.corners, edges), same_signs) << i;
        (same_signs ? met : passed)++;
        if (!same_signs) continue;
        ASSERT_TRUE(same_bits(edges.a, expected[0])) << i;
        ASSERT_TRUE(same_bits(edges.b, expected[1])) << i;
        ASSERT_TRUE(same_bits(edges.c, expected[2])) << i;
    }
    EXPECT_GT(met, 4000);
    EXPECT_GT(passed, 1000);
    EXPECT_GT(beyond_double, 100);
}

TEST(Lattice, CrossingsAreThoseOfExpansions) {
    std::mt19937 random(3);
    int answers[3] = {}, inside = 0;
    for (int i = 0; i < 20000; ++i) {
        const Case given = random_case(random);
        const PreparedRay ray = given.prepared();
        EdgeFunctions edges = edge_functions(ray, given.corners);
        if (edges.pass_by() || !decide_edges(ray, given.corners, edges)) continue;
        if (edges.a + edges.b + edges.c == 0.0) continue;
        PlaneCrossing expected, crossing;
        const bool hit = expanded_plane_crossing(ray, given.corners, expected);
        ASSERT_EQ(exact_plane_crossing(ray, given.corners, crossing), hit) << i;
        LatticeTriangle lattice;
        if (lattice.set(ray, given.corners))
            ++answers[int(lattice_plane_crossing(lattice, ray, crossing))];
        if (!hit) continue;
        ++inside;
        exact_plane_crossing(ray, given.corners, crossing);
        ASSERT_TRUE(same_bits(float(crossing.t), float(expected.t))) << i;
        ASSERT_TRUE(same_bits(float(crossing.u), float(expected.u))) << i;
        ASSERT_TRUE(same_bits(float(crossing.v), float(expected.v))) << i;
    }
    EXPECT_GT(inside, 5000);
    EXPECT_GT(answers[int(LatticeAnswer::inside)], 4000);
    EXPECT_GT(answers[int(LatticeAnswer::outside)], 100);
    EXPECT_GT(answers[int(LatticeAnswer::unknown)], 100);  // where the interval ends at the hit
}

/// The quotient 2^24 + 1 is half-way between two floats: double may not say which it becomes.
TEST(Lattice, LeavesHalfWayQuotientsToExpansions) {
    const Case given{{{0.25F, 0.25F, 0x1p24F}, 0.0F, {0.0F, 0.0F, -1.0F}, 0x1p30F},
                     {{0.0F, 0.0F, -1.0F}, {1.0F, 0.0F, -1.0F}, {0.0F, 1.0F, -1.0F}}};
    const PreparedRay ray = given.prepared();
    LatticeTriangle lattice;
    PlaneCrossing crossing;
    ASSERT_TRUE(lattice.set(ray, given.corners));
    EXPECT_EQ(lattice_plane_crossing(lattice, ray, crossing), LatticeAnswer::unknown);
    ASSERT_TRUE(exact_plane_crossing(ray, given.corners, crossing));
    EXPECT_EQ(crossing.t, 0x1p24 + 1.0);
}

/// The largest numbers that are let through do not overflow, one beyond them is turned away.
TEST(Lattice, TurnsAwayWhatDoesNotFit) {
    const auto fits = [](int exponent) {  // a 1 and 2^exponent - 1 on each axis
        const float large = std::ldexp(1.0F, exponent), one = 1.0F;
        const Case given{{glm::vec3(one), 0.0F, glm::vec3(large, one, large), 1.0F},
                         {{large, -large, large}, {-large, large, large}, {large, large, -large}}};
        const PreparedRay ray = given.prepared();
        LatticeTriangle lattice;
        if (!lattice.set(ray, given.corners)) return false;
        for (int from = 0; from < 3; ++from) {
            const int to = (from + 1) % 3;
            const ExactSum expected = exact_volume(given.ray.origin, given.ray.direction,
                                                   given.corner(from), given.corner(to));
            EXPECT_EQ(double(lattice.edge(from, to)) * lattice.edge_unit, expected.value());
        }
        return true;
    };
    EXPECT_TRUE(fits(24));
    EXPECT_TRUE(fits(40));
    EXPECT_FALSE(fits(42));
    EXPECT_FALSE(fits(61));
    EXPECT_FALSE(fits(120));
}

}  // namespace
}  // namespace bvhlab
