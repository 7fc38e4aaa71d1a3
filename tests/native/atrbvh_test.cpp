// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/atrbvh.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "build/agglomeration.h"
#include "build/lbvh.h"
#include "bvh/depth_first.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build(const Mesh& mesh, const AtrbvhConfig& config = {}, BuildLog* log = nullptr) {
    Token token;
    BuildLog own_log;
    return build_atrbvh(mesh, CostModel{}, config, token, log ? *log : own_log);
}

/// Triangles squeezed into a plane (one axis flat), a line (two), or a point (three).
Mesh flattened(Mesh mesh, int flat_axes) {
    for (glm::vec3& vertex : mesh.vertices)
        for (int axis = 0; axis < flat_axes; ++axis) vertex[axis] = 0.25F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// Most of the triangles in one cell of the Morton grid, one far away.
Mesh crowded(std::size_t count) {
    Mesh mesh = scaled(random_soup(count), 1e-9F);
    mesh.vertices[0] = {1.0F, 1.0F, 1.0F};
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// Node i has leaf i on the left and the rest on the right.
BinaryBvh chain(const Mesh& mesh) {
    const auto n = std::uint32_t(mesh.size());
    BinaryBvh bvh = BinaryBvh::with_references(n);
    for (std::uint32_t i = 0; i < n; ++i) {
        bvh.references[i] = i;
        bvh.boxes[n - 1 + i] = mesh.box(i);
    }
    for (std::uint32_t i = n - 1; i-- > 0;) {
        bvh.children[i] = {n - 1 + i, i + 2 < n ? i + 1 : 2 * n - 2};
        bvh.boxes[i] = unite(bvh.boxes[n - 1 + i], bvh.boxes[bvh.children[i].right]);
    }
    return bvh;
}

// --- agglomeration ---------------------------------------------------------------------------

/// The sets of boxes, a bit each, that the merges unite.
std::set<std::uint32_t> united_sets(const std::vector<Merge>& merges, int count) {
    std::vector<std::uint32_t> parts;
    for (int i = 0; i < count; ++i) parts.push_back(1U << i);
    std::set<std::uint32_t> sets;
    for (const Merge merge : merges) {
        EXPECT_EQ(parts.at(merge.left) & parts.at(merge.right), 0U);
        parts.push_back(parts[merge.left] | parts[merge.right]);
        sets.insert(parts.back());
    }
    return sets;
}

/// As agglomerate, by a search of all pairs before each merge.
std::vector<Merge> slow_agglomeration(const std::vector<Box>& boxes) {
    struct Cluster {
        Box box;
        std::uint8_t part;
    };
    std::vector<Cluster> clusters;
    for (const Box& box : boxes) clusters.push_back({box, std::uint8_t(clusters.size())});
    std::vector<Merge> merges;
    while (clusters.size() > 1) {
        double least = std::numeric_limits<double>::infinity();
        std::size_t best_a = 0, best_b = 0;
        for (std::size_t a = 0; a < clusters.size(); ++a) {
            for (std::size_t b = a + 1; b < clusters.size(); ++b) {
                const double area = unite(clusters[a].box, clusters[b].box).half_area();
                if (area >= least) continue;
                least = area;
                best_a = a;
                best_b = b;
            }
        }
        merges.push_back({clusters[best_a].part, clusters[best_b].part});
        clusters[best_a] = {unite(clusters[best_a].box, clusters[best_b].box),
                            std::uint8_t(boxes.size() + merges.size() - 1)};
        clusters.erase(clusters.begin() + std::ptrdiff_t(best_b));
    }
    return merges;
}

std::vector<Merge> fast_agglomeration(const std::vector<Box>& boxes) {
    BoxRows rows;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        for (int axis = 0; axis < 3; ++axis) {
            rows.lower[axis][i] = boxes[i].lower[axis];
            rows.upper[axis][i] = boxes[i].upper[axis];
        }
    }
    std::vector<Merge> merges(boxes.size() - 1);
    agglomerate(rows, int(boxes.size()), merges.data());
    return merges;
}

TEST(Agglomeration, MergesThePairOfLeastUnionFirst) {
    for (std::uint32_t seed = 0; seed < 200; ++seed) {
        const int count = 2 + int(seed % (max_treelet_size - 1));
        const Mesh mesh = random_soup(std::size_t(count), seed % 3 == 0 ? 1.0F : 0.1F, seed);
        std::vector<Box> boxes;
        for (std::size_t i = 0; i < mesh.size(); ++i) boxes.push_back(mesh.box(i));
        EXPECT_EQ(united_sets(fast_agglomeration(boxes), count),
                  united_sets(slow_agglomeration(boxes), count))
            << "seed " << seed;
    }
}

TEST(Agglomeration, UnitesAllWhereUnionsAreEqual) {
    for (const Box& box : {Box{{0, 0, 0}, {1, 1, 1}}, Box{{2, 2, 2}, {2, 2, 2}},
                           Box{{0, 1, 1}, {1, 1, 1}}, Box{{0, 0, 1}, {1, 1, 1}}}) {
        for (int count = 2; count <= int(max_treelet_size); ++count) {
            const auto merges = fast_agglomeration(std::vector<Box>(std::size_t(count), box));
            EXPECT_EQ(united_sets(merges, count).count((1U << count) - 1), 1U);
        }
    }
}

// --- treelets --------------------------------------------------------------------------------

TEST(Treelet, OpensTheLeafOfLargestArea) {
    const Mesh mesh = random_soup(500);
    Token token;
    const BinaryBvh bvh = build_lbvh(mesh, token);
    const unsigned size = 20;
    const Treelet treelet = form_treelet(bvh, 0, size);
    double least_opened = std::numeric_limits<double>::infinity(), area = 0.0;
    std::set<std::uint32_t> below{bvh.children[0].left, bvh.children[0].right};
    for (unsigned i = 1; i + 1 < size; ++i) {
        const std::uint32_t node = treelet.interior[i];
        for (const std::uint32_t other : below) {
            if (!bvh.is_leaf(other)) {
                EXPECT_GE(bvh.boxes[node].half_area(), bvh.boxes[other].half_area());
            }
        }
        EXPECT_EQ(below.erase(node), 1U);
        below.insert({bvh.children[node].left, bvh.children[node].right});
        least_opened = std::min(least_opened, bvh.boxes[node].half_area());
        area += bvh.boxes[node].half_area();
    }
    EXPECT_EQ(below, std::set(treelet.leaves.begin(), treelet.leaves.begin() + size));
    EXPECT_DOUBLE_EQ(treelet.area, area);
}

TEST(Treelet, PassesVisitEachNodeAfterThoseBelow) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    const Mesh mesh = random_soup(20000);
    Token token;
    for (BinaryBvh bvh : {build_lbvh(mesh, token), chain(mesh)}) {
        const Array<std::uint32_t> counts = reference_counts(bvh, token);
        std::vector<std::atomic<int>> visits(bvh.children.size());
        BuildLog log;
        with_threads(7, [&] {
            restructure_treelets(bvh, counts, {20, 3, 0.0}, {}, {}, token, log,
                                 [&](std::uint32_t root) {
                                     const int pass = ++visits[root];
                                     const auto [left, right] = bvh.children[root];
                                     for (const std::uint32_t child : {left, right}) {
                                         if (!bvh.is_leaf(child) && counts[child] >= 10U << pass) {
                                             EXPECT_EQ(visits[child], pass);
                                         }
                                     }
                                     return 0.0;
                                 });
        });
        for (std::size_t node = 0; node < visits.size(); ++node) {
            const std::uint32_t count = counts[node];
            EXPECT_EQ(visits[node], (count >= 20) + (count >= 40) + (count >= 80));
        }
        EXPECT_STREQ(log.ended, "iteration limit");
    }
}

// --- the builder -----------------------------------------------------------------------------

TEST(Atrbvh, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh : {random_soup(1),
                             random_soup(2),
                             random_soup(3),
                             random_soup(19),
                             random_soup(20),
                             random_soup(20000),
                             random_soup(5000, 2),
                             copies(21),
                             copies(100000),
                             sphere(40),
                             flattened(random_soup(5000), 1),
                             flattened(random_soup(5000), 2),
                             flattened(random_soup(5000), 3),
                             crowded(20000),
                             growing_chain(3000, 1.03),
                             growing_chain(100, 3.0),
                             scaled(random_soup(5000), 1e30F),
                             scaled(random_soup(5000), 1e-30F),
                             scaled(random_soup(5000), 5e36F),
                             scaled(random_soup(5000), 1e-40F)}) {
        const BinaryBvh bvh = build(mesh);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_EQ(bvh.reference_count(), mesh.size());
    }
}

TEST(Atrbvh, IsValidForEveryTreeletSize) {
    const Mesh mesh = random_soup(3000);
    for (int size = 4; size <= int(max_treelet_size); ++size)
        EXPECT_NO_THROW(validate(build(mesh, {.treelet_size = size}), mesh));
}

TEST(Atrbvh, CostFallsWithEachPass) {
    for (const Mesh& mesh : {random_soup(20000), sphere(60), growing_chain(3000, 1.03)}) {
        BuildLog log;
        const BinaryBvh bvh = build(mesh, {}, &log);
        ASSERT_EQ(log.steps.size(), 1U + unsigned(std::bit_width(mesh.size() / 20)));
        for (std::size_t i = 1; i < log.steps.size(); ++i) {
            EXPECT_EQ(log.steps[i].iteration, i);
            EXPECT_LE(log.steps[i].cost, log.steps[i - 1].cost);
            EXPECT_GE(log.steps[i].seconds, log.steps[i - 1].seconds);
        }
        Token token;
        EXPECT_EQ(log.steps.front().cost, cost(build_lbvh(mesh, token), {}));
        EXPECT_NEAR(log.steps.back().cost, cost(bvh, {}), 1e-9 * cost(bvh, {}));
        EXPECT_STREQ(log.ended, "converged");
    }
}

TEST(Atrbvh, ImprovesTheBaseTree) {
    BuildLog log;
    build(random_soup(20000), {}, &log);
    EXPECT_LT(log.steps.back().cost, 0.95 * log.steps.front().cost);
}

TEST(Atrbvh, LeavesTreesSmallerThanATreelet) {
    const Mesh mesh = random_soup(19);
    Token token;
    BuildLog log;
    EXPECT_TRUE(same(build(mesh, {}, &log), depth_first(build_lbvh(mesh, token))));
    EXPECT_STREQ(log.ended, "converged");
}

TEST(Atrbvh, DoesNotDependOnTheScale) {
    const Mesh mesh = random_soup(5000);
    const BinaryBvh bvh = build(mesh);
    for (const float factor : {0x1p-100F, 0x1p100F}) {
        const BinaryBvh other = build(scaled(mesh, factor));
        EXPECT_EQ(bvh.references, other.references);
        EXPECT_EQ(0, std::memcmp(bvh.children.data(), other.children.data(),
                                 bvh.children.size() * sizeof(bvh.children[0])));
    }
}

TEST(Atrbvh, KeepsToItsLimits) {
    const Mesh mesh = random_soup(20000);
    Token token;
    BuildLog log;
    EXPECT_TRUE(same(build(mesh, {.iterations = 0}, &log), depth_first(build_lbvh(mesh, token))));
    EXPECT_EQ(log.steps.size(), 1U);
    EXPECT_STREQ(log.ended, "iteration limit");

    log = {};
    EXPECT_NO_THROW(validate(build(mesh, {.iterations = 2}, &log), mesh));
    EXPECT_EQ(log.steps.size(), 3U);
    EXPECT_STREQ(log.ended, "iteration limit");

    for (const double seconds : {1e-9, 0.01}) {
        log = {};
        EXPECT_NO_THROW(validate(build(mesh, {.max_seconds = seconds}, &log), mesh));
    }
    log = {};
    build(mesh, {.max_seconds = 1e-9}, &log);
    EXPECT_STREQ(log.ended, "time limit");
}

TEST(Atrbvh, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    for (const Mesh& mesh : {random_soup(30000), sphere(80)}) {
        BuildLog one_log, many_log;
        const BinaryBvh one = with_threads(1, [&] { return build(mesh, {}, &one_log); });
        const BinaryBvh many = with_threads(7, [&] { return build(mesh, {}, &many_log); });
        EXPECT_TRUE(same(one, many));
        for (std::size_t i = 0; i < one_log.steps.size(); ++i)
            EXPECT_EQ(one_log.steps[i].cost, many_log.steps[i].cost);
    }
}

TEST(Atrbvh, IsTheSameForAnyInstructionSet) {
    const Mesh mesh = random_soup(3000, 0.3F);
    const BinaryBvh best = build(mesh);
    const auto supported = hwy::SupportedTargets();
    for (auto target = supported & -supported, rest = supported; rest != 0;
         rest &= rest - 1, target = rest & -rest) {
        hwy::SetSupportedTargetsForTest(target);
        EXPECT_TRUE(same(best, build(mesh)));
    }
    hwy::SetSupportedTargetsForTest(0);
}

TEST(Atrbvh, StopsWhenCancelled) {
    const Mesh mesh = random_soup(100000);
    BuildLog log;
    Token token;
    token.cancel();
    EXPECT_THROW(build_atrbvh(mesh, {}, {}, token, log), Cancelled);

    Token later;
    std::thread canceller([&] {
        while (std::isnan(later.cost())) std::this_thread::yield();  // until the passes begin
        later.cancel();
    });
    EXPECT_THROW(build_atrbvh(mesh, {}, {.treelet_size = 30}, later, log), Cancelled);
    canceller.join();
}

TEST(Atrbvh, ReportsProgressAndCost) {
    Token token;
    BuildLog log;
    build_atrbvh(random_soup(20000), {}, {}, token, log);
    EXPECT_STREQ(token.stage(), "building ATRBVH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    EXPECT_EQ(token.cost(), log.steps.back().cost);
}

}  // namespace
}  // namespace bvhlab
