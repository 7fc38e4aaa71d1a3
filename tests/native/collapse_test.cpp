// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/collapse.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "build/lbvh.h"
#include "bvh/validate.h"
#include "meshes.h"

namespace bvhlab {
namespace {

using namespace test;

/// Least cost of `node`'s subtree as at most `trees` wide trees, by trying everything, as Ylitie et
/// al. define it.
struct Exhaustive {
    const BinaryBvh& binary;
    CostModel model;
    unsigned k;

    double area(std::uint32_t node) const {
        return binary.boxes[node].half_area() / binary.boxes[0].half_area();
    }
    std::size_t size(std::uint32_t node) const {
        if (binary.is_leaf(node)) return 1;
        return size(binary.children[node].left) + size(binary.children[node].right);
    }
    double as_leaf(std::uint32_t node) const {
        return area(node) * model.intersection * double(charged_tests(size(node), k));
    }
    double split(std::uint32_t node, unsigned trees) const {
        double best = std::numeric_limits<double>::infinity();
        for (unsigned left = 1; left < trees; ++left)
            best = std::min(best, forest(binary.children[node].left, left) +
                                      forest(binary.children[node].right, trees - left));
        return best;
    }
    double as_node(std::uint32_t node) const {
        return area(node) * model.traversal + split(node, k);
    }
    double forest(std::uint32_t node, unsigned trees) const {
        if (binary.is_leaf(node)) return as_leaf(node);
        if (trees == 1) return std::min(as_leaf(node), as_node(node));
        return std::min(forest(node, trees - 1), split(node, trees));
    }
};

TEST(Collapse, FindsTheLeastCost) {
    Token token;
    for (std::uint32_t seed = 0; seed < 6; ++seed) {
        const auto mesh = shared(random_soup(12, 0.3F, seed));
        const BinaryBvh binary = build_lbvh(*mesh, token);
        for (const unsigned k : {2U, 4U, 8U}) {
            const CostModel model{3.0, seed % 2 ? 2.0 : 0.2};
            const Bvh bvh = collapse(binary, mesh, k, model, token);
            EXPECT_NEAR(cost(bvh, model), (Exhaustive{binary, model, k}.as_node(0)), 1e-5)
                << "seed " << seed << " k " << k;
        }
    }
}

TEST(Collapse, IsValidOnEveryShapeOfInput) {
    Token token;
    for (Mesh& mesh : std::vector<Mesh>{random_soup(1), random_soup(2), random_soup(5000),
                                        copies(1), copies(100000), growing_chain(3000, 1.03)}) {
        const auto held = shared(std::move(mesh));
        const BinaryBvh binary = build_lbvh(*held, token);
        for (const unsigned k : {2U, 4U, 8U}) {
            const Bvh bvh = collapse(binary, held, k, {}, token);
            EXPECT_NO_THROW(validate(bvh));
            EXPECT_EQ(bvh.reference_count, held->size());
        }
    }
}

/// A chain: node i has leaf i on the left and the rest on the right, as deep as it is long.
BinaryBvh chain(const Mesh& mesh) {
    const auto n = std::uint32_t(mesh.size());
    BinaryBvh binary = BinaryBvh::with_references(n);
    for (std::uint32_t i = 0; i < n; ++i) {
        binary.references[i] = i;
        binary.boxes[n - 1 + i] = mesh.box(i);
    }
    for (std::uint32_t i = n - 1; i-- > 0;) {
        binary.children[i] = {n - 1 + i, i + 2 < n ? i + 1 : 2 * n - 2};
        binary.boxes[i] = unite(binary.boxes[n - 1 + i], binary.boxes[binary.children[i].right]);
    }
    return binary;
}

TEST(Collapse, TakesTreesAsDeepAsTheyAreLong) {
    const auto mesh = shared(growing_chain(200000, 1.0));
    Token token;
    for (const unsigned k : {2U, 8U})
        EXPECT_NO_THROW(validate(collapse(chain(*mesh), mesh, k, {1e-3, 1e3}, token)));
}

TEST(Collapse, CostOfOneTriangleIsANodeAndALeaf) {
    const auto mesh = shared(copies(1));
    Token token;
    const BinaryBvh binary = build_lbvh(*mesh, token);
    EXPECT_DOUBLE_EQ(cost(collapse(binary, mesh, 2, {}, token), {}), 3.0 + 2.0);
    EXPECT_DOUBLE_EQ(cost(collapse(binary, mesh, 8, {}, token), {}), 3.0 + 2.0 * 8);
}

TEST(Validate, FindsEachDefect) {
    Token token;
    const auto mesh = shared(random_soup(500));
    const Bvh good = collapse(build_lbvh(*mesh, token), mesh, 4, {}, token);
    const auto broken = [&](auto change) {
        Bvh bvh = good;
        change(bvh, std::get<WideBvh<4>>(bvh.tree));
        EXPECT_THROW(validate(bvh), std::logic_error);
    };
    const auto leaf_of = [](WideBvh<4>& wide) -> std::pair<WideNode<4>&, unsigned> {
        for (auto& node : wide.nodes)
            for (unsigned i = 0; i < 4; ++i)
                if (node.is_leaf(i)) return {node, i};
        throw std::logic_error("no leaf");
    };
    broken([](Bvh& bvh, auto&) { ++bvh.max_depth; });
    broken([](Bvh& bvh, auto&) { ++bvh.reference_count; });
    broken([](Bvh& bvh, auto&) { ++bvh.leaf_count; });
    broken([](Bvh&, auto& wide) { wide.nodes.pop_back(); });
    broken([](Bvh&, auto& wide) { wide.blocks.pop_back(); });
    broken([](Bvh&, auto& wide) { wide.nodes[0].planes[1][0] = std::nanf(""); });
    broken([](Bvh&, auto& wide) { wide.nodes.back().planes[0][0] -= 10.0F; });
    broken([](Bvh&, auto& wide) { wide.blocks[0].triangle[0] = no_triangle; });
    broken([](Bvh&, auto& wide) { wide.blocks[0].triangle[0] ^= 1U; });
    broken([](Bvh&, auto& wide) { wide.blocks[0].corners[1][2][0] += 1.0F; });
    broken([&](Bvh&, auto& wide) {
        auto [node, i] = leaf_of(wide);
        node.child[i] += 1;
    });
    broken([&](Bvh&, auto& wide) {
        auto [node, i] = leaf_of(wide);
        node.count[i] += 4;
    });
}

}  // namespace
}  // namespace bvhlab
