// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/trbvh.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "bvh/collapse.h"
#include "bvh/depth_first.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build(const Mesh& mesh, const TrbvhConfig& config = {}, BuildLog* log = nullptr) {
    Token token;
    BuildLog own_log;
    return build_trbvh(mesh, CostModel{}, config, token, log ? *log : own_log);
}

/// Triangles squeezed into a plane (one axis flat), a line (two), or a point (three).
Mesh flattened(Mesh mesh, int flat_axes) {
    for (glm::vec3& vertex : mesh.vertices)
        for (int axis = 0; axis < flat_axes; ++axis) vertex[axis] = 0.25F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// A tree over few triangles, grown one triangle at a time; nodes 0 .. n-1 are leaves.
struct SmallTree {
    struct Node {
        int parent, left, right;
        Box box;
        double references;
    };
    std::vector<Node> nodes;
    int root = -1;
};

/// Cost in units of area where each subtree may be made a leaf.
double collapsed_cost(const SmallTree& tree, int id, const CostModel& model, Box& box,
                      double& references) {
    const SmallTree::Node& node = tree.nodes[std::size_t(id)];
    if (node.left < 0) {
        box = node.box;
        references = 1.0;
        return model.intersection * box.half_area();
    }
    Box right_box;
    double right_references;
    double parts = collapsed_cost(tree, node.left, model, box, references);
    parts += collapsed_cost(tree, node.right, model, right_box, right_references);
    box.grow(right_box);
    references += right_references;
    return std::min(model.traversal * box.half_area() + parts,
                    model.intersection * box.half_area() * references);
}

/// Puts leaf `next` beside every node there is, in turn, and so on with the leaves after it: this
/// meets each of the (2n - 3)!! topologies once.
void try_all(SmallTree& tree, int next, int leaves, const CostModel& model, double& least,
             int& tried) {
    if (next == leaves) {
        Box box;
        double references;
        least = std::min(least, collapsed_cost(tree, tree.root, model, box, references));
        ++tried;
        return;
    }
    const std::vector<SmallTree::Node> before = tree.nodes;
    const int root = tree.root;
    for (int sibling = 0; sibling < int(before.size()); ++sibling) {
        if (sibling >= next && sibling < leaves) continue;  // a leaf that is not in the tree yet
        const int parent = before[std::size_t(sibling)].parent, added = int(before.size());
        tree.nodes.push_back({parent, sibling, next, {}, 0.0});
        tree.nodes[std::size_t(sibling)].parent = tree.nodes[std::size_t(next)].parent = added;
        if (parent < 0)
            tree.root = added;
        else if (tree.nodes[std::size_t(parent)].left == sibling)
            tree.nodes[std::size_t(parent)].left = added;
        else
            tree.nodes[std::size_t(parent)].right = added;
        try_all(tree, next + 1, leaves, model, least, tried);
        tree.nodes = before;
        tree.root = root;
    }
}

double least_cost(const Mesh& mesh, const CostModel& model, int& tried) {
    SmallTree tree;
    for (std::size_t i = 0; i < mesh.size(); ++i)
        tree.nodes.push_back({-1, -1, -1, mesh.box(i), 1.0});
    tree.root = 0;
    double least = std::numeric_limits<double>::infinity();
    try_all(tree, 1, int(mesh.size()), model, least, tried);
    return least;
}

/// The same of a tree as built.
double collapsed_cost(const BinaryBvh& bvh, std::uint32_t node, const CostModel& model,
                      double& references) {
    const double area = bvh.boxes[node].half_area();
    references = 1.0;
    if (bvh.is_leaf(node)) return model.intersection * area;
    double right_references;
    const auto [left, right] = bvh.children[node];
    double parts = collapsed_cost(bvh, left, model, references);
    parts += collapsed_cost(bvh, right, model, right_references);
    references += right_references;
    return std::min(model.traversal * area + parts, model.intersection * area * references);
}

TEST(Trbvh, FindsTheBestOfAllTopologies) {
    const int double_factorials[] = {3, 15, 105, 945, 10395};  // (2n - 3)!! for n = 3 ..
    const CostModel models[] = {{3.0, 2.0}, {0.3, 2.0}, {10.0, 1.0}};
    for (std::uint32_t seed = 0; seed < 60; ++seed) {
        const int size = seed < 6 ? 7 : 3 + int(seed % 4);
        const CostModel& model = models[seed % 3];
        const Mesh mesh = random_soup(std::size_t(size), seed % 2 == 0 ? 0.3F : 1.0F, seed);
        Token token;
        BuildLog log;
        const BinaryBvh bvh = build_trbvh(mesh, model, {.treelet_size = size}, token, log);
        EXPECT_NO_THROW(validate(bvh, mesh));
        int tried = 0;
        double references;
        const double least = least_cost(mesh, model, tried);
        EXPECT_EQ(tried, double_factorials[size - 3]);
        EXPECT_NEAR(collapsed_cost(bvh, 0, model, references), least, 1e-12 * least)
            << "seed " << seed;
    }
}

TEST(Trbvh, CountsTheReferencesOfTheLeafNotOfTheTreelet) {
    // Two far clusters of coinciding triangles: each is best as one leaf, which a leaf cost with
    // all the treelet's references would not show.
    const CostModel model{.traversal = 10.0, .intersection = 1.0};
    Array<glm::vec3> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {9, 0, 0}, {8, 0, 0}, {9, 1, 0}};
    const Mesh mesh =
        make_mesh(std::move(vertices),
                  {{0, 1, 2}, {3, 4, 5}, {0, 1, 2}, {3, 4, 5}, {0, 1, 2}, {3, 4, 5}, {3, 4, 5}});
    Token token;
    BuildLog log;
    const auto held = shared(mesh);
    const Bvh bvh = collapse(build_trbvh(*held, model, {}, token, log), held, 2, model, token);
    EXPECT_EQ(bvh.leaf_count, 2U);
    EXPECT_EQ(bvh.max_leaf_size, 4U);
}

TEST(Trbvh, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh :
         {random_soup(1), random_soup(2), random_soup(3), random_soup(6), random_soup(7),
          random_soup(20000), random_soup(5000, 2), copies(8), copies(100000), sphere(40),
          flattened(random_soup(5000), 1), flattened(random_soup(5000), 2),
          flattened(random_soup(5000), 3), growing_chain(3000, 1.03), growing_chain(100, 3.0),
          scaled(random_soup(5000), 1e30F), scaled(random_soup(5000), 1e-30F),
          scaled(random_soup(5000), 5e36F), scaled(random_soup(5000), 1e-40F)}) {
        const BinaryBvh bvh = build(mesh);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_EQ(bvh.reference_count(), mesh.size());
    }
}

TEST(Trbvh, CostAfterCollapseFallsWithEachPass) {
    for (const Mesh& mesh :
         {random_soup(10000), sphere(50), random_soup(3000, 2), growing_chain(3000, 1.03)}) {
        for (const int size : {3, 7, 8}) {
            double before = std::numeric_limits<double>::infinity(), references;
            for (int iterations = 0; iterations < 12; iterations += 1 + iterations / 3) {
                BuildLog log;
                const TrbvhConfig config{.treelet_size = size, .iterations = iterations};
                const BinaryBvh bvh = build(mesh, config, &log);
                const double now = collapsed_cost(bvh, 0, {}, references);
                EXPECT_LE(now, before * (1.0 + 1e-12));
                EXPECT_NEAR(log.steps.back().cost, cost(bvh, {}), 1e-9 * cost(bvh, {}));
                before = now;
            }
        }
    }
}

TEST(Trbvh, ImprovesTheBaseTree) {
    const Mesh mesh = random_soup(20000);
    Token token;
    double references;
    const BinaryBvh base = build_lbvh(mesh, token);
    EXPECT_LT(collapsed_cost(build(mesh), 0, {}, references),
              0.95 * collapsed_cost(base, 0, {}, references));
}

TEST(Trbvh, DoesNotDependOnTheScale) {
    const Mesh mesh = random_soup(5000);
    const BinaryBvh bvh = build(mesh);
    for (const float factor : {0x1p-100F, 0x1p100F}) {
        const BinaryBvh other = build(scaled(mesh, factor));
        EXPECT_EQ(bvh.references, other.references);
        EXPECT_EQ(0, std::memcmp(bvh.children.data(), other.children.data(),
                                 bvh.children.size() * sizeof(bvh.children[0])));
    }
}

TEST(Trbvh, KeepsToItsLimits) {
    const Mesh mesh = random_soup(20000);
    Token token;
    BuildLog log;
    const BinaryBvh base = build(mesh, {.iterations = 0}, &log);
    EXPECT_EQ(base.references, build_lbvh(mesh, token).references);
    EXPECT_STREQ(log.ended, "iteration limit");

    log = {};
    build(mesh, {.iterations = 64}, &log);
    EXPECT_STREQ(log.ended, "converged");

    log = {};
    EXPECT_NO_THROW(validate(build(mesh, {.max_seconds = 1e-9}, &log), mesh));
    EXPECT_STREQ(log.ended, "time limit");
    EXPECT_NO_THROW(validate(build(mesh, {.max_seconds = 0.01}), mesh));
}

TEST(Trbvh, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    for (const Mesh& mesh : {random_soup(30000), sphere(80)}) {
        const BinaryBvh one = with_threads(1, [&] { return build(mesh); });
        const BinaryBvh many = with_threads(7, [&] { return build(mesh); });
        EXPECT_TRUE(same(one, many));
    }
}

TEST(Trbvh, StopsWhenCancelled) {
    const Mesh mesh = random_soup(100000);
    BuildLog log;
    Token token;
    token.cancel();
    EXPECT_THROW(build_trbvh(mesh, {}, {}, token, log), Cancelled);

    Token later;
    std::thread canceller([&] {
        while (std::isnan(later.cost())) std::this_thread::yield();  // until the passes begin
        later.cancel();
    });
    EXPECT_THROW(build_trbvh(mesh, {}, {.treelet_size = 8}, later, log), Cancelled);
    canceller.join();
}

TEST(Trbvh, ReportsProgressAndCost) {
    Token token;
    BuildLog log;
    build_trbvh(random_soup(20000), {}, {}, token, log);
    EXPECT_STREQ(token.stage(), "building TRBVH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    EXPECT_EQ(token.cost(), log.steps.back().cost);
}

}  // namespace
}  // namespace bvhlab
