// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/metrics.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "bvh/epo.h"
#include "metrics_samples.h"

namespace bvhlab {
namespace {

using test::build;
using test::compressed;
using test::copies;
using test::growing_chain;
using test::random_soup;
using test::rooms;
using test::shared;
using test::single_leaves;
using test::sphere;
using test::triangles;
using test::with_smallest_leaves;

LeafCounts leaf_counts(const Bvh& bvh, std::size_t lines) {
    Token token;
    return leaf_count_variability(bvh, lines, token);
}

// --- leaf counts ---------------------------------------------------------------------------------

/// Sum of the leaves' areas over the scene's.
double expected_leaves(const Bvh& bvh) {
    return std::visit(
        []<class Tree>(const Tree& wide) {
            constexpr unsigned K = Tree::branching;
            Box scene = Box::empty();
            for (unsigned i = 0; i < K; ++i) scene.grow(wide.node(0).box(i));
            double sum = 0.0;
            for (std::size_t n = 0; n < wide.nodes.size(); ++n) {
                const WideNode<K>& node = wide.node(n);
                for (unsigned i = 0; i < K; ++i)
                    if (node.is_leaf(i)) sum += node.box(i).half_area();
            }
            return sum / scene.half_area();
        },
        bvh.tree);
}

/// A triangle whose box is the given one.
Triangle diagonal(const glm::vec3& lower, const glm::vec3& upper) {
    return {lower, upper, {lower.x, upper.y, lower.z}};
}

TEST(LeafCounts, HaveTheMeanThatAreasPredict) {
    const std::vector<Mesh> meshes = {random_soup(2000, 0.1F, 3), random_soup(200, 0.8F, 4),
                                      rooms(9), sphere(20)};
    for (const Mesh& plain : meshes) {
        const auto mesh = shared(Mesh(plain));
        for (const char* builder : {"lbvh", "sbvh"}) {
            for (const unsigned branching : {2U, 4U, 8U, compressed}) {
                const Bvh bvh = build(mesh, builder, branching);
                const LeafCounts counts = leaf_counts(bvh, 1 << 14);
                const double error = counts.deviation / 128.0;
                EXPECT_GT(counts.deviation, 0.0);
                EXPECT_NEAR(counts.mean, expected_leaves(bvh), 4.5 * error);
            }
        }
    }
}

TEST(LeafCounts, AreUniformLinesInBoxesOfAnyProportion) {
    // An off-centre box in a long flat scene: met with the ratio p of areas, so the count is
    // 1 + Bernoulli(p).
    const Box scene{{-3, 10, 5}, {37, 12, 11}};
    for (const Box& inner : {Box{{-2, 11, 6}, {0, 12, 10}}, Box{{5, 10, 5}, {30, 10.5F, 8}},
                             Box{{36, 10, 5}, {37, 12, 11}}}) {
        const auto mesh =
            triangles({diagonal(scene.lower, scene.upper), diagonal(inner.lower, inner.upper)});
        const Bvh bvh = build(mesh, "sah", 2, single_leaves);
        const LeafCounts counts = leaf_counts(bvh, 1 << 18);
        const double p = inner.half_area() / scene.half_area(), deviation = std::sqrt(p * (1 - p));
        EXPECT_NEAR(counts.mean, 1.0 + p, 4.5 * deviation / 512.0);
        EXPECT_NEAR(counts.deviation, deviation, 4.5 * counts.error);
        EXPECT_LT(counts.error, 0.01);
    }
}

TEST(LeafCounts, OfTwoHalvesAreTwoWhereTheLineCrossesTheirFace) {
    const auto mesh = triangles({diagonal({0, 0, 0}, {1, 3, 2}), diagonal({1, 0, 0}, {4, 3, 2})});
    const LeafCounts counts = leaf_counts(build(mesh, "sah", 2, single_leaves), 1 << 18);
    const double p = 6.0 / (4 * 3 + 3 * 2 + 2 * 4);  // the face has two sides of 3 x 2
    EXPECT_NEAR(counts.mean, 1.0 + p, 4.5 * counts.deviation / 512.0);
    EXPECT_NEAR(counts.deviation, std::sqrt(p * (1 - p)), 4.5 * counts.error);
}

TEST(LeafCounts, OfOneLeafDoNotVary) {
    const auto mesh = triangles({diagonal({0, 0, 0}, {1, 2, 3})});
    const LeafCounts counts = leaf_counts(build(mesh, "lbvh", 8), 1000);
    EXPECT_EQ(counts.mean, 1.0);
    EXPECT_EQ(counts.deviation, 0.0);
    EXPECT_EQ(counts.error, 0.0);
}

TEST(LeafCounts, OfTilesAreOneFromBothSides) {
    std::vector<Triangle> list;
    for (int x = 0; x < 8; ++x)
        for (int y = 0; y < 8; ++y) list.push_back({{x, y, 3}, {x + 1, y + 1, 3}, {x, y + 1, 3}});
    const auto mesh = triangles(list);
    const LeafCounts counts = leaf_counts(build(mesh, "sah", 2, single_leaves), 10000);
    EXPECT_EQ(counts.mean, 1.0);
    EXPECT_EQ(counts.deviation, 0.0);
}

TEST(LeafCounts, SayHowSureTheyAre) {
    const Bvh bvh = build(shared(random_soup(1000, 0.3F)), "lbvh", 2);
    const LeafCounts few = leaf_counts(bvh, 2000), many = leaf_counts(bvh, 128000);
    EXPECT_NEAR(few.error / many.error, 8.0, 1.5);
    EXPECT_NEAR(few.deviation, many.deviation, 4.0 * few.error);
}

TEST(LeafCounts, TakeManyTrianglesInOnePlace) {
    const auto mesh = shared(copies(100000));
    const LeafCounts counts = leaf_counts(with_smallest_leaves(mesh, 2), 1000);
    EXPECT_EQ(counts.mean, double(mesh->size()));
    EXPECT_EQ(counts.deviation, 0.0);
}

// --- everything together -------------------------------------------------------------------------

Metrics measured(const Bvh& bvh, int threads = 0) {
    Token token;
    return with_threads(threads, [&] { return measure(bvh, {}, 4096, token); });
}

TEST(Metrics, CountDepthsAndLeafSizes) {
    for (const unsigned branching : {2U, 4U, 8U}) {
        const Bvh bvh = build(shared(random_soup(3000)), "sbvh", branching);
        const Metrics metrics = measured(bvh);
        EXPECT_EQ(metrics.cost, cost(bvh, {}));
        EXPECT_EQ(metrics.shape.max_depth, bvh.max_depth);
        EXPECT_GT(metrics.shape.mean_leaf_depth, 1.0);
        EXPECT_LE(metrics.shape.mean_leaf_depth, double(bvh.max_depth));
        std::size_t leaves = 0, references = 0;
        for (std::size_t size = 0; size < metrics.shape.leaf_sizes.size(); ++size) {
            leaves += metrics.shape.leaf_sizes[size];
            references += size * metrics.shape.leaf_sizes[size];
        }
        EXPECT_EQ(leaves, bvh.leaf_count);
        EXPECT_EQ(references, bvh.reference_count);
        EXPECT_EQ(metrics.shape.leaf_sizes.size(), bvh.max_leaf_size + 1);
        EXPECT_EQ(metrics.nodes, bvh.interior_count() + bvh.leaf_count);
        EXPECT_EQ(metrics.bytes, bvh.node_bytes() + bvh.leaf_bytes());
    }
    const Bvh chain = build(shared(growing_chain(60, 3.0)), "sah", 2, single_leaves);
    const Shape deep = shape(chain);
    EXPECT_EQ(deep.max_depth, chain.max_depth);
    EXPECT_GT(deep.max_depth, 20U);
}

TEST(Metrics, AreTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    const Bvh bvh = build(shared(random_soup(5000, 0.2F)), "sbvh", 4);
    const Metrics one = measured(bvh, 1);
    for (const int threads : {2, 7}) {
        const Metrics many = measured(bvh, threads);
        EXPECT_EQ(one.epo, many.epo);
        EXPECT_EQ(one.leaf_counts.mean, many.leaf_counts.mean);
        EXPECT_EQ(one.leaf_counts.deviation, many.leaf_counts.deviation);
        EXPECT_EQ(one.leaf_counts.error, many.leaf_counts.error);
    }
}

TEST(Metrics, DoNotDependOnTheUnit) {
    const Metrics plain = measured(build(shared(random_soup(500, 0.3F)), "sah", 4));
    // Powers of two, so that the vertices keep all their digits.
    for (const float factor : {0x1p-100F, 0x1p100F, 0x1p120F}) {
        const Bvh bvh = build(shared(test::scaled(random_soup(500, 0.3F), factor)), "sah", 4);
        const Metrics metrics = measured(bvh);
        EXPECT_NEAR(metrics.epo, plain.epo, 1e-12 * plain.epo);
        EXPECT_NEAR(metrics.leaf_counts.mean, plain.leaf_counts.mean, 1e-9);
        EXPECT_NEAR(metrics.leaf_counts.deviation, plain.leaf_counts.deviation, 1e-9);
    }
}

TEST(Metrics, AreZeroWhereThereIsNoArea) {
    Array<glm::vec3> line;
    Array<glm::uvec3> indices;
    for (std::uint32_t i = 0; i < 40; ++i) {
        for (int corner = 0; corner < 3; ++corner)
            line.push_back({float(i) + 0.25F * float(corner), 0.0F, 0.0F});
        indices.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const Metrics collinear =
        measured(build(shared(make_mesh(std::move(line), std::move(indices))), "lbvh", 4));
    EXPECT_EQ(collinear.epo, 0.0);
    EXPECT_EQ(collinear.leaf_counts.mean, 0.0);
    EXPECT_EQ(collinear.leaf_counts.deviation, 0.0);

    const Metrics point =
        measured(build(triangles({{{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}}), "sbvh", 8));
    EXPECT_EQ(point.epo, 0.0);
    EXPECT_EQ(point.leaf_counts.error, 0.0);
    EXPECT_EQ(point.shape.max_depth, 1U);
    EXPECT_EQ(point.shape.mean_leaf_depth, 1.0);
}

TEST(Metrics, AreFiniteOnHardInputs) {
    for (Mesh& mesh : std::vector<Mesh>{
             growing_chain(2000, 1.04), growing_chain(100, 3.0), random_soup(1), random_soup(2),
             test::scaled(random_soup(500), 1e-40F), test::scaled(random_soup(500), 1e30F),
             test::scaled(random_soup(500), 1e-30F), copies(1000)}) {
        const auto part = shared(std::move(mesh));
        for (const unsigned branching : {2U, 8U}) {
            const Metrics metrics = measured(build(part, "lbvh", branching));
            EXPECT_TRUE(std::isfinite(metrics.epo) && metrics.epo >= 0.0);
            EXPECT_TRUE(std::isfinite(metrics.leaf_counts.mean));
            EXPECT_TRUE(std::isfinite(metrics.leaf_counts.deviation));
            EXPECT_TRUE(std::isfinite(metrics.leaf_counts.error));
        }
    }
}

TEST(Metrics, StopWhenCancelled) {
    Token token;
    token.cancel();
    const Bvh small = build(shared(random_soup(10)), "lbvh", 2);
    EXPECT_THROW(end_point_overlap(small, {}, token), Cancelled);
    EXPECT_THROW(leaf_count_variability(small, 100, token), Cancelled);

    // Large triangles that all overlap: many seconds of work.
    const Bvh bvh = build(shared(random_soup(20000, 1.0F)), "lbvh", 2);
    const auto seconds_to_stop = [&](auto&& work) {
        Token running;
        Stopwatch watch;
        double cancelled = 0.0;
        std::thread canceller([&] {
            std::this_thread::sleep_for(std::chrono::milliseconds(200));
            cancelled = watch.seconds();
            running.cancel();
        });
        EXPECT_THROW(work(running), Cancelled);
        const double stopped = watch.seconds();
        canceller.join();
        return stopped - cancelled;
    };
    // 0.1 s is promised on an idle machine; tests share theirs.
    EXPECT_LT(seconds_to_stop([&](Token& t) { end_point_overlap(bvh, {}, t); }), 1.0);
    EXPECT_LT(seconds_to_stop([&](Token& t) { leaf_count_variability(bvh, 1 << 24, t); }), 1.0);
}

TEST(Metrics, ReportProgress) {
    Token token;
    const Bvh bvh = build(shared(random_soup(1000)), "lbvh", 2);
    end_point_overlap(bvh, {}, token);
    EXPECT_STREQ(token.stage(), "measuring end-point overlap");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    leaf_count_variability(bvh, 1000, token);
    EXPECT_STREQ(token.stage(), "measuring leaf-count variability");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
}

}  // namespace
}  // namespace bvhlab
