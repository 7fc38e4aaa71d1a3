// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/lbvh.h"

#include <gtest/gtest.h>

#include "base/parallel.h"
#include "build/morton.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

TEST(Morton, InterleavesEachAxis) {
    EXPECT_EQ(spread_by_three(0b101), 0b1000001U);
    EXPECT_EQ(spread_by_three(0x1FFFFF), 0x1249249249249249U);
    const MortonGrid grid({{0, 0, 0}, {1, 2, 4}});
    const auto code = [&](glm::vec3 p) { return grid.code({p, p}); };
    EXPECT_EQ(code({0, 0, 0}), 0U);
    EXPECT_EQ(code({1, 2, 4}), (1ULL << 60) - 1);
    EXPECT_EQ(code({1, 0, 0}), 0x249249249249249ULL);  // x in the lowest bit of each triple
    EXPECT_GT(code({0, 0, 4}), code({1, 2, 0}));       // z splits first
}

TEST(Morton, FlatAxisIsCellZero) {
    const MortonGrid grid({{0, 5, 0}, {1, 5, 1}});
    EXPECT_EQ(grid.code({{1, 5, 0}, {1, 5, 0}}) & 0x492492492492492ULL, 0U);
}

TEST(Lbvh, IsValidOnEveryShapeOfInput) {
    Token token;
    for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), random_soup(20000),
                             copies(1), copies(100000), growing_chain(3000, 1.03), sphere(40)})
        EXPECT_NO_THROW(validate(build_lbvh(mesh, token), mesh));
}

TEST(Lbvh, IsTheSameForAnyThreadCount) {
    const Mesh mesh = random_soup(50000);
    Token token;
    const BinaryBvh one = with_threads(1, [&] { return build_lbvh(mesh, token); });
    const BinaryBvh many = with_threads(7, [&] { return build_lbvh(mesh, token); });
    EXPECT_TRUE(same(one, many));
}

TEST(Lbvh, SplitsWhereTheHighestBitChanges) {
    // Centres at the cells 0, 1, 3 of a line: 3 parts from 0 and 1 first.
    const Mesh mesh =
        make_mesh({{0, 0, 0}, {1, 0, 0}, {3, 0, 0}}, {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}});
    Token token;
    const BinaryBvh bvh = build_lbvh(mesh, token);
    EXPECT_EQ(bvh.reference(bvh.children[0].right), 2U);
    EXPECT_FALSE(bvh.is_leaf(bvh.children[0].left));
}

TEST(Lbvh, StopsWhenCancelled) {
    Token token;
    token.cancel();
    EXPECT_THROW(build_lbvh(random_soup(10), token), Cancelled);
}

}  // namespace
}  // namespace bvhlab
