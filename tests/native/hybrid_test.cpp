// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/hybrid.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/parallel.h"
#include "build/leaf_clusters.h"
#include "bvh/collapse.h"
#include "bvh/depth_first.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build_base(const Mesh& mesh) {
    Token token;
    return build_sbvh(mesh, {}, {}, token);
}

BinaryBvh build(const Mesh& mesh, const PrbvhConfig& config = {}, BuildLog* log = nullptr) {
    Token token;
    BuildLog unused;
    return build_hybrid(mesh, {}, {}, config, token, log ? *log : unused);
}

double collapsed_cost(const BinaryBvh& bvh, const Mesh& mesh, unsigned branching) {
    Token token;
    return cost(collapse(bvh, shared(mesh), branching, {}, token), {});
}

TEST(LeafClusters, ArePutBackWhereTheyWere) {
    for (const std::size_t count : {1U, 2U, 3U, 50U, 5000U}) {
        const BinaryBvh base = build_base(random_soup(count));
        const LeafClusters clusters = cut_leaf_clusters(base, {}, Token());
        EXPECT_TRUE(same(put_back(clusters.top, clusters, base, Token()), depth_first(base)));
    }
}

TEST(LeafClusters, AreTheLeavesOfTheCollapse) {
    const auto mesh = shared(random_soup(5000));
    const BinaryBvh base = build_base(*mesh);
    Token token;
    const Bvh collapsed = collapse(base, mesh, 2, {}, token);
    EXPECT_EQ(cut_leaf_clusters(base, {}, token).roots.size(), collapsed.leaf_count);
    EXPECT_LT(collapsed.leaf_count, base.reference_count());
    // Where a leaf's tests cost nothing, all is one leaf but for the root's children.
    EXPECT_EQ(cut_leaf_clusters(base, {.traversal = 3.0, .intersection = 1e-9}, token).roots.size(),
              2U);
}

TEST(Hybrid, LowersTheCostOfTheCollapsedTree) {
    const Mesh mesh = random_soup(5000);
    BuildLog log;
    const BinaryBvh bvh = build(mesh, {}, &log);
    validate(bvh, mesh);
    EXPECT_STREQ(log.ended, "converged");
    const BinaryBvh base = build_base(mesh);
    EXPECT_NEAR(log.steps.front().cost, cost(base, {}), 1e-4 * cost(base, {}));
    EXPECT_NEAR(log.steps.back().cost, cost(bvh, {}), 1e-4 * cost(bvh, {}));
    for (const unsigned branching : {2U, 4U, 8U})
        EXPECT_LT(collapsed_cost(bvh, mesh, branching),
                  0.995 * collapsed_cost(base, mesh, branching));
}

TEST(Hybrid, TakesTinyAndOddMeshes) {
    for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), copies(300),
                             growing_chain(60, 4.0), sphere(8)}) {
        const BinaryBvh bvh = build(mesh);
        validate(bvh, mesh);
        EXPECT_LE(collapsed_cost(bvh, mesh, 2),
                  collapsed_cost(build_base(mesh), mesh, 2) * (1.0 + 1e-6));
    }
}

TEST(Hybrid, IsTheSameForAnyThreadCount) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 7);
    const Mesh mesh = random_soup(20000);
    const BinaryBvh one = with_threads(1, [&] { return build(mesh); });
    for (const int threads : {2, 7})
        EXPECT_TRUE(same(with_threads(threads, [&] { return build(mesh); }), one));
}

TEST(Hybrid, StopsAtItsLimitsAndWhenCancelled) {
    const Mesh mesh = random_soup(5000);
    BuildLog log;
    validate(build(mesh, {.iterations = 1}, &log), mesh);
    EXPECT_STREQ(log.ended, "iteration limit");
    log = {};
    validate(build(mesh, {.max_seconds = 1e-9}, &log), mesh);
    EXPECT_STREQ(log.ended, "time limit");
    Token token;
    token.cancel();
    EXPECT_THROW(build_hybrid(mesh, {}, {}, {}, token, log), Cancelled);
}

}  // namespace
}  // namespace bvhlab
