// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/reorder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "meshes.h"

namespace bvhlab {
namespace {

using namespace test;
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr Reorder orders[] = {Reorder::aila, Reorder::origin, Reorder::octahedron,
                              Reorder::two_point};

/// A number written as 32 bits, with blanks between groups.
std::uint32_t bits(const char* text) {
    std::uint32_t number = 0;
    int count = 0;
    for (; *text != '\0'; ++text) {
        if (*text == ' ') continue;
        number = number << 1 | std::uint32_t(*text == '1');
        ++count;
    }
    EXPECT_EQ(count, 32);
    return number;
}

/// Key in a box from (1, 1, 1) to (3, 3, 2): a cube of side 2.
std::uint32_t key(Reorder order, glm::vec3 origin, glm::vec3 direction, float t_max = infinity) {
    return RayKeys({glm::vec3(1.0F), {3.0F, 3.0F, 2.0F}})(order, {origin, 0.0F, direction, t_max});
}

TEST(Reorder, AilaTakesThreeLevelsOfTheOriginFirst) {
    const auto aila = [](glm::vec3 origin, glm::vec3 direction) {
        return key(Reorder::aila, origin, direction);
    };
    // The origin's x is the last cell; the direction's x and y are the last below the middle.
    EXPECT_EQ(aila({3, 1, 1}, {0, 0, 7}), bits("100 100 100  100 001  100 111  100 111  100 11"));
    EXPECT_EQ(aila({1, 3, 1}, {-2, 0, 0}), bits("010 010 010  010 000  010 011  010 011  010 01"));
    // A quarter and a half up in z: binary 0.00111... and 0.0111...
    EXPECT_EQ(aila({1, 1, 1.5F}, {0, 1e-30F, 0}),
              bits("000 000 001  001 010  001 111  001 111  001 11"));
    EXPECT_EQ(aila({1, 1, 2}, {0, -1e30F, 0}),
              bits("000 001 001  001 000  001 101  001 101  001 10"));
}

TEST(Reorder, OriginTakesTheOriginAlone) {
    for (const glm::vec3 direction : {glm::vec3(1, 0, 0), glm::vec3(-3, 2, 1)}) {
        EXPECT_EQ(key(Reorder::origin, {3, 2, 1}, direction),
                  bits("100 110 110 110 110 110 110 110 110 110 11"));
        EXPECT_EQ(key(Reorder::origin, {1, 1, 1.5F}, direction),
                  bits("000 000 001 001 001 001 001 001 001 001 00"));
    }
}

TEST(Reorder, OctahedronUnfoldsTheDirection) {
    const auto towards = [](glm::vec3 direction) {
        return key(Reorder::octahedron, {3, 1, 1}, direction);
    };
    EXPECT_EQ(towards({0, 0, 9}), bits("100 100 100 100  100 00  100 11  100 11  100 11"));
    EXPECT_EQ(towards({0, 0, -9}), bits("100 100 100 100  100 11  100 11  100 11  100 11"));
    EXPECT_EQ(towards({9, 0, 0}), bits("100 100 100 100  100 10  100 11  100 11  100 11"));
    EXPECT_EQ(towards({-9, 0, 0}), bits("100 100 100 100  100 00  100 01  100 01  100 01"));
    // (1, 1, 2) / 4 is at (0.625, 0.625); below, the same is folded out to (0.875, 0.875).
    EXPECT_EQ(towards({1, 1, 2}), bits("100 100 100 100  100 11  100 00  100 00  100 11"));
    EXPECT_EQ(towards({1, 1, -2}), bits("100 100 100 100  100 11  100 11  100 00  100 11"));
}

TEST(Reorder, TwoPointGoesAQuarterOfTheSceneOrToTheEnd) {
    const auto ends = [](glm::vec3 direction, float t_max) {
        return key(Reorder::two_point, {1, 1, 1}, direction, t_max);
    };
    const std::uint32_t quarter = bits("000 000  000 000  000 001  000 001  000 001  00");
    EXPECT_EQ(ends({0, 0, 5}, infinity), quarter);
    EXPECT_EQ(ends({0, 0, 5e30F}, infinity), quarter);
    EXPECT_EQ(ends({0, 0, 5}, 0.11F), quarter);
    EXPECT_EQ(ends({0, 0, 5}, 0.05F), bits("000 000  000 000  000 000  000 001  000 001  00"));
    EXPECT_EQ(ends({0, 0, 5}, -1.0F), 0U);
    EXPECT_EQ(key(Reorder::two_point, {3, 1, 1}, {0, 1, 0}),
              bits("100 100  100 100  100 110  100 110  100 110  10"));
}

TEST(Reorder, KeysKnowNoScaleAndNoPlace) {
    std::mt19937 random(8);
    for (int i = 0; i < 200; ++i) {
        const glm::vec3 origin = uniform_vector(random, -0.5F, 1.5F);
        const glm::vec3 direction = uniform_vector(random, -1.0F, 1.0F);
        const RayKeys here({glm::vec3(0.0F), glm::vec3(1.0F)});
        for (const float scale : {0x1p-60F, 0x1p-20F, 0x1p20F, 0x1p100F}) {
            const RayKeys there({glm::vec3(0.0F), glm::vec3(scale)});
            for (const Reorder order : orders)
                EXPECT_EQ(here(order, {origin, 0.0F, direction, 0.1F}),
                          there(order, {scale * origin, 0.0F, scale * direction, 0.1F}));
        }
    }
    const RayKeys flat({glm::vec3(4.0F), glm::vec3(4.0F)});  // a scene of one point
    EXPECT_EQ(flat(Reorder::two_point, {glm::vec3(9.0F), 0.0F, {1, 1, 1}, infinity}),
              flat(Reorder::two_point, {glm::vec3(4.0F), 0.0F, {1, 0, 0}, 1.0F}));
}

TEST(Reorder, SortsByKeyAndKeepsEqualOnesInOrder) {
    const Box unit_box{glm::vec3(0), glm::vec3(1)};
    std::vector<glm::vec3> origins, directions;
    std::mt19937 random(4);
    for (int i = 0; i < 10000; ++i) {
        origins.push_back(uniform_vector(random, -0.2F, 1.2F));
        directions.push_back(uniform_vector(random, -1.0F, 1.0F));
        if (i % 3 == 0) origins.back() = glm::vec3(0.5F), directions.back() = {0, 0, 1};
    }
    const std::vector<float> t_min{0.0F}, t_max{infinity};
    const RayBatch rays{origins, directions, t_min, t_max};
    for (const Reorder order : orders) {
        const RayOrder ordered = order_rays(order, rays, unit_box, Token{});
        std::vector<std::uint32_t> expected(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i) expected[i] = std::uint32_t(i);
        const RayKeys of(unit_box);
        std::ranges::stable_sort(expected, {},
                                 [&](std::uint32_t ray) { return of(order, rays[ray]); });
        EXPECT_TRUE(std::ranges::equal(ordered.order, expected)) << reorder_names[int(order)];
    }
}

TEST(Reorder, HasNames) {
    for (std::size_t i = 0; i < reorder_names.size(); ++i)
        EXPECT_EQ(reorder_named(reorder_names[i]), Reorder(i));
    try {
        reorder_named("morton");
        FAIL();
    } catch (const std::invalid_argument& error) {
        EXPECT_STREQ(error.what(),
                     "unknown ray order 'morton'; there are: off, aila, origin, octahedron, "
                     "two_point");
    }
}

}  // namespace
}  // namespace bvhlab
