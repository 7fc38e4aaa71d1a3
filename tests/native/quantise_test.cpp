// SPDX-License-Identifier: GPL-3.0-or-later
// What makes a compressed node: boxes on its grid, children in its slots.
#include "bvh/quantise.h"

#include <gtest/gtest.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <vector>

#include "bvh/octant_slots.h"
#include "meshes.h"

namespace bvhlab {
namespace {

using namespace test;
constexpr float largest = std::numeric_limits<float>::max();
constexpr float least = std::numeric_limits<float>::denorm_min();

// --- quantising ----------------------------------------------------------------------------------

/// Encodes all boxes, box i in slot 7 - i, and checks that each decodes to one that holds it, by at
/// most two quanta where that can be told: a quantum is one step of the grid or one rounding.
void expect_tight(std::span<const Box> boxes, bool saturated = false) {
    std::array<std::uint8_t, 8> slots;
    for (std::size_t i = 0; i < 8; ++i) slots[i] = std::uint8_t(7 - i);
    CompressedNode node;
    quantise(boxes, {slots.data(), boxes.size()}, node);
    Box all = Box::empty();
    for (const Box& box : boxes) all.grow(box);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Box decoded = node.box(slots[i]);
        ASSERT_TRUE(decoded.contains(boxes[i]));
        for (int axis = 0; axis < 3 && !saturated; ++axis) {
            ASSERT_TRUE(std::isfinite(decoded.upper[axis]));
            const double extent = double(all.upper[axis]) - double(all.lower[axis]);
            const double step = std::max(double(node.step(axis)), 0x1p-126);
            ASSERT_LE(step, std::max(extent / 127.5 * (1 + 1e-12), 0x1p-126));
            const auto excess = [&](float decoded_plane, float plane) {
                const double rounding = std::abs(double(decoded_plane)) * 0x1p-23;
                return std::abs(double(decoded_plane) - double(plane)) / std::max(step, rounding);
            };
            ASSERT_LE(excess(decoded.lower[axis], boxes[i].lower[axis]), 2.0);
            ASSERT_LE(excess(decoded.upper[axis], boxes[i].upper[axis]), 2.0);
        }
    }
}

/// A float of any size, from any decade of those below `most`.
float any_float(std::mt19937& random, float most) {
    const float size = std::ldexp(uniform(random, 1.0F, 2.0F), int(random() % 277) - 149);
    return random() % 2 ? -std::min(size, most) : std::min(size, most);
}

Box box_between(const glm::vec3& a, const glm::vec3& b) {
    return {glm::min(a, b), glm::max(a, b)};
}

TEST(Quantise, HoldsBoxesOfEverySize) {
    std::mt19937 random(5);
    for (int round = 0; round < 30000; ++round) {
        std::array<Box, 8> boxes;
        const std::size_t count = 1 + random() % 8;
        for (std::size_t i = 0; i < count; ++i) {
            const auto corner = [&] {
                const float x = any_float(random, 1e37F), y = any_float(random, 1e37F);
                return glm::vec3(x, y, any_float(random, 1e37F));
            };
            boxes[i] = box_between(corner(), corner());
        }
        expect_tight({boxes.data(), count});
    }
}

/// Far from the origin the grid's planes round to few floats; on the way, ulps of both ends differ.
TEST(Quantise, HoldsSmallBoxesFarAway) {
    std::mt19937 random(6);
    for (int round = 0; round < 30000; ++round) {
        const float distance = any_float(random, 1e37F);
        const float size = std::abs(distance) * std::ldexp(1.0F, -int(random() % 30));
        std::array<Box, 8> boxes;
        for (Box& box : boxes) {
            const auto corner = [&] { return distance + size * uniform_vector(random, -1, 1); };
            box = box_between(corner(), corner());
        }
        expect_tight(boxes);
    }
}

TEST(Quantise, HoldsBoxesOfOneUlpAndOfNoExtent) {
    for (const float value : {0.0F, -0.0F, 1.0F, -1.0F, 1e6F, -3e-39F, least, 1e37F, 0x1p-126F}) {
        const float above = std::nextafter(value, largest), far = 2.0F * std::abs(value) + 1e-30F;
        for (const Box& box :
             {Box{glm::vec3(value), glm::vec3(value)}, Box{glm::vec3(value), glm::vec3(above)},
              Box{glm::vec3(value), {above, value, far}}}) {
            expect_tight({&box, 1});
            const std::array<Box, 2> both = {box, {glm::vec3(value), glm::vec3(far)}};
            expect_tight(both);
        }
    }
}

/// The difference of these planes is not a double, and rounding it hides the last bit.
TEST(Quantise, RoundsOutwardWhereDoubleCannotTell) {
    const Box wide{glm::vec3(-1.0F), glm::vec3(1.0F)};
    for (const float bit : {least, -least, 1e-30F, -1e-30F, 0x1p-100F, -0x1p-100F}) {
        const std::array<Box, 2> boxes = {wide, {glm::vec3(bit), glm::vec3(bit)}};
        expect_tight(boxes);
    }
}

TEST(Quantise, HoldsBoxesWhoseExtentOverflows) {
    const std::array<Box, 4> boxes = {
        Box{glm::vec3(-largest), glm::vec3(largest)}, Box{glm::vec3(-largest), glm::vec3(-3e38F)},
        Box{glm::vec3(3e38F), glm::vec3(largest)}, Box{glm::vec3(-1.0F), glm::vec3(1.0F)}};
    expect_tight(boxes, true);
    for (const Box& box : boxes) expect_tight({&box, 1}, true);
}

// --- slots ---------------------------------------------------------------------------------------

double slot_cost(std::span<const Box> boxes, std::span<const std::uint8_t> slots) {
    Box node = Box::empty();
    for (const Box& box : boxes) node.grow(box);
    double sum = 0.0;
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const double centre = 0.5 * double(boxes[i].lower[axis] + boxes[i].upper[axis]) -
                                  0.5 * double(node.lower[axis] + node.upper[axis]);
            sum += slots[i] & (4U >> axis) ? -centre : centre;
        }
    return sum;
}

TEST(OctantSlots, AreTheBestOfAllAssignments) {
    std::mt19937 random(9);
    for (const std::size_t count : {1U, 2U, 3U, 5U, 8U}) {
        std::vector<Box> boxes;
        for (std::size_t i = 0; i < count; ++i)
            boxes.push_back(
                box_between(uniform_vector(random, 0, 1), uniform_vector(random, 0, 1)));
        const auto chosen = octant_slots(boxes);
        std::array<std::uint8_t, 8> slots;
        std::iota(slots.begin(), slots.end(), std::uint8_t(0));
        double best = std::numeric_limits<double>::infinity();
        do best = std::min(best, slot_cost(boxes, slots));
        while (std::ranges::next_permutation(slots).found);
        EXPECT_NEAR(slot_cost(boxes, chosen), best, 1e-5) << count;
    }
}

/// Eight cubes in the eight octants: slot ^ signs ^ 7 falls with the number of axes along which a
/// cube is the farther one, up to cubes that no order tells apart.
TEST(OctantSlots, OrderChildrenAlongEveryRay) {
    std::vector<Box> boxes;
    for (unsigned i = 0; i < 8; ++i) {
        const glm::vec3 corner(i & 1U ? 1 : -2, i & 2U ? 1 : -2, i & 4U ? 1 : -2);
        boxes.push_back({corner, corner + 1.0F});
    }
    const auto slots = octant_slots(boxes);
    for (unsigned signs = 0; signs < 8; ++signs) {
        const glm::vec3 direction(signs & 4U ? -1 : 1, signs & 2U ? -1 : 1, signs & 1U ? -1 : 1);
        for (unsigned i = 0; i < 8; ++i) {
            const unsigned rank = 7 - (slots[i] ^ signs ^ 7U);  // 0 is visited first
            const float depth = glm::dot(0.5F * (boxes[i].lower + boxes[i].upper), direction);
            EXPECT_EQ(depth, -4.5F + 3.0F * float(std::popcount(rank)));
        }
    }
}

}  // namespace
}  // namespace bvhlab
