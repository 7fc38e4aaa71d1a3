// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/prbvh.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "bvh/depth_first.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

constexpr CostModel model;

BinaryBvh build(const Mesh& mesh, const PrbvhConfig& config = {}) {
    Token token;
    BuildLog log;
    return build_prbvh(mesh, model, config, token, log);
}

BinaryBvh build_base(const Mesh& mesh) {
    Token token;
    return build_lbvh(mesh, token);
}

Mesh flat(Mesh mesh, int axis) {
    for (glm::vec3& vertex : mesh.vertices) vertex[axis] = 1.0F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

Mesh beside_one_far_away(std::size_t count) {
    Mesh mesh = scaled(random_soup(count), 1e-7F);
    for (int corner = 0; corner < 3; ++corner) mesh.vertices[std::size_t(corner)] += 1.0F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

std::size_t expect_depth_first(const BinaryBvh& bvh) {
    std::vector<std::uint32_t> waiting{0};
    std::uint32_t next_node = 0, next_leaf = bvh.first_leaf();
    while (!waiting.empty()) {
        const std::uint32_t node = waiting.back();
        waiting.pop_back();
        EXPECT_EQ(node, bvh.is_leaf(node) ? next_leaf : next_node);
        ++(bvh.is_leaf(node) ? next_leaf : next_node);
        if (bvh.is_leaf(node)) continue;
        waiting.push_back(bvh.children[node].right);
        waiting.push_back(bvh.children[node].left);
    }
    return next_leaf;
}

/// The tree with its interior nodes (but the root) and its leaves numbered at random.
BinaryBvh shuffled(const BinaryBvh& bvh) {
    std::mt19937 random(7);
    std::vector<std::uint32_t> number(bvh.node_count());
    for (std::uint32_t i = 0; i < number.size(); ++i) number[i] = i;
    const auto first_leaf = std::ptrdiff_t(bvh.first_leaf());
    std::shuffle(number.begin() + 1, number.begin() + first_leaf, random);
    std::shuffle(number.begin() + first_leaf, number.end(), random);
    BinaryBvh other = BinaryBvh::with_references(bvh.reference_count());
    for (std::uint32_t node = 0; node < bvh.node_count(); ++node) {
        other.boxes[number[node]] = bvh.boxes[node];
        if (bvh.is_leaf(node))
            other.references[number[node] - bvh.first_leaf()] = bvh.reference(node);
        else
            other.children[number[node]] = {number[bvh.children[node].left],
                                            number[bvh.children[node].right]};
    }
    return other;
}

TEST(DepthFirst, RestoresShuffledTrees) {
    for (const std::size_t count : {2U, 3U, 100U, 30000U}) {
        const BinaryBvh base = build_base(random_soup(count));  // is in depth-first order
        EXPECT_TRUE(same(depth_first(base), base));
        EXPECT_TRUE(same(depth_first(shuffled(base)), base));
    }
    EXPECT_EQ(depth_first(build_base(random_soup(1))).reference_count(), 1U);
    Token cancelled;
    cancelled.cancel();
    EXPECT_THROW(depth_first(build_base(random_soup(30000)), cancelled), Cancelled);
}

TEST(DepthFirst, TakesChains) {
    constexpr std::uint32_t count = 300000;
    BinaryBvh chain = BinaryBvh::with_references(count);
    for (std::uint32_t i = 0; i < count; ++i) chain.references[i] = i;
    for (Box& box : chain.boxes) box = {glm::vec3(0.0F), glm::vec3(1.0F)};
    for (std::uint32_t i = 0; i + 1 < count; ++i)  // deepest last, numbered against the depth
        chain.children[i] = {count - 1 + i, i + 2 < count ? i + 1 : 2 * count - 2};
    const BinaryBvh ordered = depth_first(shuffled(chain));
    EXPECT_EQ(expect_depth_first(ordered), ordered.node_count());
}

TEST(Prbvh, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh :
         {random_soup(1), random_soup(2), random_soup(3), random_soup(10000),
          random_soup(2000, 2.0F), sphere(30), copies(1), copies(2), copies(20000),
          flat(random_soup(5000), 0), flat(flat(random_soup(5000), 0), 1),
          flat(flat(flat(random_soup(500), 0), 1), 2), scaled(random_soup(3000), 1e30F),
          scaled(random_soup(3000), 1e-30F), scaled(random_soup(3000), 1e-40F),
          scaled(random_soup(3000), 5e36F), growing_chain(3000, 1.02), growing_chain(100, 3.0),
          beside_one_far_away(5000)}) {
        const BinaryBvh bvh = build(mesh);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_EQ(expect_depth_first(bvh), bvh.node_count());
        EXPECT_LE(cost(bvh, model), cost(build_base(mesh), model) * (1.0 + 1e-6));
    }
}

TEST(Prbvh, LowersTheCostOfItsBase) {
    const Mesh mesh = random_soup(5000);
    EXPECT_LT(cost(build(mesh), model), 0.9 * cost(build_base(mesh), model));
}

TEST(Prbvh, SplitBaseIsImproved) {
    const Mesh mesh = random_soup(1000, 0.5F);
    Token token;
    BuildLog log;
    const BinaryBvh bvh = build_prbvh_s(mesh, model, {.max_leaf_size = 1}, {}, token, log);
    EXPECT_GT(bvh.reference_count(), mesh.size());
    EXPECT_NO_THROW(validate(bvh, mesh));
    EXPECT_LT(cost(bvh, model), log.steps.front().cost);
    EXPECT_STREQ(token.stage(), "building PRBVH_S");
}

TEST(Prbvh, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    for (const Mesh& mesh : {random_soup(20000), sphere(60)}) {
        const BinaryBvh one = with_threads(1, [&] { return build(mesh); });
        for (const int threads : {2, 7})
            EXPECT_TRUE(same(one, with_threads(threads, [&] { return build(mesh); })));
    }
}

TEST(Prbvh, LogsFallingCostsAndWhyItEnded) {
    const Mesh mesh = random_soup(5000);
    Token token;
    BuildLog log;
    build_prbvh(mesh, model, {}, token, log);
    EXPECT_STREQ(log.ended, "converged");
    EXPECT_STREQ(token.stage(), "building PRBVH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    ASSERT_GT(log.steps.size(), 3U);
    EXPECT_DOUBLE_EQ(token.cost(), log.steps.back().cost);
    for (std::size_t i = 0; i < log.steps.size(); ++i) {
        EXPECT_EQ(log.steps[i].iteration, i);
        if (i == 0) continue;
        EXPECT_LE(log.steps[i].cost, log.steps[i - 1].cost);
    }
}

TEST(Prbvh, ReturnsAValidTreeWhenLimited) {
    const Mesh mesh = random_soup(20000);
    for (const PrbvhConfig& config :
         {PrbvhConfig{.iterations = 0}, PrbvhConfig{.iterations = 2},
          PrbvhConfig{.max_seconds = 1e-6}, PrbvhConfig{.iterations = 3, .sparsity = 8}}) {
        Token token;
        BuildLog log;
        const BinaryBvh bvh = build_prbvh(mesh, model, config, token, log);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_STREQ(log.ended, config.max_seconds > 0.0 ? "time limit" : "iteration limit");
        EXPECT_EQ(log.steps.size(),
                  1U + (config.max_seconds > 0.0 ? 1U : std::size_t(config.iterations)));
        EXPECT_NEAR(cost(bvh, model), log.steps.back().cost, 1e-3);
    }
}

TEST(Prbvh, SparseSearchConvergesToo) {
    const Mesh mesh = random_soup(5000);
    const double all = cost(build(mesh), model);
    EXPECT_NEAR(cost(build(mesh, {.sparsity = 8}), model), all, 0.03 * all);
}

TEST(Prbvh, StopsWhenCancelled) {
    Token token;
    BuildLog log;
    token.cancel();
    EXPECT_THROW(build_prbvh(random_soup(10000), model, {}, token, log), Cancelled);

    const Mesh mesh = random_soup(100000);
    Token later;
    Stopwatch since_cancel;
    std::thread canceller([&] {
        while (later.cost() != later.cost()) std::this_thread::yield();  // NaN until the first
        since_cancel = Stopwatch();
        later.cancel();
    });
    EXPECT_THROW(build_prbvh(mesh, model, {}, later, log), Cancelled);
    canceller.join();
    EXPECT_LT(since_cancel.seconds(), 0.5);  // 0.1 s where the machine is not shared
}

}  // namespace
}  // namespace bvhlab
