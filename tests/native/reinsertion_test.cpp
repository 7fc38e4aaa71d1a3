// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "build/reinsertion_optimiser.h"
#include "bvh/validate.h"
#include "meshes.h"

namespace bvhlab {
namespace {

using namespace test;

constexpr CostModel model;

BinaryBvh build_base(const Mesh& mesh) {
    Token token;
    return build_lbvh(mesh, token);
}

Mesh flat(Mesh mesh) {
    for (glm::vec3& vertex : mesh.vertices) vertex.z = 1.0F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

struct PlainNode {
    int left = -1, right = -1, parent = -1;
    Box box;
};

/// A tree by pointers that can move nodes the obvious way.
class PlainTree {
public:
    explicit PlainTree(const ReinsertionTree& tree) : nodes_(tree.slot_count()) {
        for (std::uint32_t slot = 0; slot < tree.slot_count(); ++slot) {
            if (slot == 1) continue;
            const SlotPair& pair = tree.pairs[slot / 2];
            const std::uint32_t side = slot % 2;
            nodes_[slot].box = {{pair.lower_xy[side], pair.lower_xy[2 + side], pair.z[side]},
                                {-pair.negated_upper_xy[side], -pair.negated_upper_xy[2 + side],
                                 -pair.z[2 + side]}};
            if (tree.is_leaf(pair.child[side])) continue;
            nodes_[slot].left = int(2 * pair.child[side]);
            nodes_[slot].right = int(2 * pair.child[side] + 1);
            nodes_[std::size_t(nodes_[slot].left)].parent = int(slot);
            nodes_[std::size_t(nodes_[slot].right)].parent = int(slot);
        }
    }

    bool contains(int node, int other) const {
        for (; other >= 0; other = nodes_[std::size_t(other)].parent)
            if (other == node) return true;
        return false;
    }
    int parent(int node) const { return nodes_[std::size_t(node)].parent; }
    int sibling(int node) const {
        const PlainNode& up = nodes_[std::size_t(parent(node))];
        return up.left == node ? up.right : up.left;
    }

    /// Removes `node` with its parent, and puts both back above `target`.
    void reinsert(int node, int target) {
        const int up = parent(node), other = sibling(node);
        replace(up, other);
        const int above = parent(target);
        nodes_[std::size_t(up)].parent = above;
        if (above >= 0) {
            PlainNode& top = nodes_[std::size_t(above)];
            (top.left == target ? top.left : top.right) = up;
        }
        nodes_[std::size_t(up)].left = target;
        nodes_[std::size_t(up)].right = node;
        nodes_[std::size_t(target)].parent = nodes_[std::size_t(node)].parent = up;
    }

    /// Sum of the half areas of the interior nodes.
    double area() const {
        double sum = 0.0;
        for (std::size_t node = 0; node < nodes_.size(); ++node)
            if (nodes_[node].left >= 0) sum += box(int(node)).half_area();
        return sum;
    }

private:
    void replace(int node, int by) {
        const int above = parent(node);
        nodes_[std::size_t(by)].parent = above;
        if (above < 0) return;
        PlainNode& top = nodes_[std::size_t(above)];
        (top.left == node ? top.left : top.right) = by;
    }

    Box box(int node) const {
        const PlainNode& n = nodes_[std::size_t(node)];
        return n.left < 0 ? n.box : unite(box(n.left), box(n.right));
    }

    std::vector<PlainNode> nodes_;
};

/// The gains of all positions that a node could move to.
std::vector<double> gains_by_trial(const ReinsertionTree& tree, int slot) {
    const PlainTree before(tree);
    std::vector<double> gains(tree.slot_count(), -1e30);
    for (int target = 0; target < int(tree.slot_count()); ++target) {
        if (target <= 1 || before.contains(slot, target) || target == before.parent(slot) ||
            target == before.sibling(slot))
            continue;
        PlainTree after = before;
        after.reinsert(slot, target);
        gains[std::size_t(target)] = before.area() - after.area();
    }
    return gains;
}

/// Takes down what the search offers, and enters everything.
struct EveryPosition {
    std::vector<std::pair<std::uint32_t, float>> offers;

    void begin(float) {}
    void offer(float gain, std::uint32_t target, std::uint32_t) {
        offers.emplace_back(target, gain);
    }
    bool hopes(float, float) const { return true; }
    bool ends(float) const { return false; }
};

/// Searches for one node alone.
template <class Choice>
Choice search_for(const ReinsertionTree& tree, std::uint32_t slot, const Choice& start = {}) {
    std::array<Choice, 2> choices{start, start};
    ReinsertionSearch(tree).run(slot / 2, choices, {slot % 2 == 0, slot % 2 == 1});
    return choices[slot % 2];
}

TEST(ReinsertionSearch, FindsTheBestOfAllPositions) {
    Token token;
    for (std::uint32_t seed = 0; seed < 12; ++seed) {
        const Mesh mesh = random_soup(3 + seed * 2, seed % 2 == 0 ? 0.1F : 0.7F, seed);
        ReinsertionTree tree = reinsertion_tree(build_base(mesh), token);
        refit(tree, token);
        int improvements = 0;
        for (std::uint32_t slot = 2; slot < tree.slot_count(); ++slot) {
            const std::vector<double> gains = gains_by_trial(tree, int(slot));
            const double best = *std::ranges::max_element(gains);

            const auto every = search_for<EveryPosition>(tree, slot);
            std::set<std::uint32_t> offered;
            for (const auto& [target, gain] : every.offers) {
                EXPECT_NEAR(gain, gains[target], 1e-5) << slot << " to " << target;
                EXPECT_TRUE(offered.insert(target).second) << "offered twice";
            }
            // Only ancestors are left out, once they are known to be no better than one below.
            double best_offered = -1e30;
            for (const std::uint32_t target : offered)
                best_offered = std::max(best_offered, gains[target]);
            for (std::uint32_t target = 2; target < tree.slot_count(); ++target) {
                if (gains[target] < -1e29 || offered.contains(target)) continue;
                EXPECT_TRUE(PlainTree(tree).contains(int(target), int(slot)));
                EXPECT_LE(gains[target], best_offered + 1e-6);
            }

            const auto choice = search_for<BestReinsertion>(tree, slot);
            std::array<BestReinsertion, 2> both;
            ReinsertionSearch(tree).run(slot / 2, both, {true, true});
            EXPECT_EQ(both[slot % 2].best.gain, choice.best.gain);
            EXPECT_EQ(both[slot % 2].best.target, choice.best.target);
            EXPECT_NEAR(choice.best.gain, std::max(best, 0.0), 1e-5);
            if (choice.best.target == Reinsertion::none) continue;
            ++improvements;
            EXPECT_NEAR(gains[choice.best.target], best, 1e-5);
        }
        if (seed > 1) {
            EXPECT_GT(improvements, 0);
        }
    }
}

TEST(ReinsertionSearch, TemperatureZeroIsHillClimbing) {
    Token token;
    const Mesh mesh = random_soup(400);
    ReinsertionTree tree = reinsertion_tree(build_base(mesh), token);
    refit(tree, token);
    const Heat cold{.temperature = 1e-20F, .prune_probability = 0.0F, .seed = 1, .iteration = 1};
    for (std::uint32_t slot = 2; slot < tree.slot_count(); ++slot) {
        const auto best = search_for<BestReinsertion>(tree, slot);
        const auto annealed = search_for(tree, slot, AnnealedReinsertion(cold, slot));
        EXPECT_EQ(best.best.gain, annealed.accepted.gain);
        EXPECT_EQ(best.best.target, annealed.accepted.target);
    }
}

TEST(ReinsertionMoves, ASingleMoveChangesTheCostByItsGain) {
    Token token;
    const BinaryBvh base = build_base(random_soup(40, 0.5F));
    ReinsertionTree start = reinsertion_tree(base, token);
    refit(start, token);
    const auto interior_area = [&](const ReinsertionTree& tree) {
        return cost(tree, {.traversal = 1.0, .intersection = 0.0}, token) *
               double(tree.half_area(ReinsertionTree::root));
    };
    for (std::uint32_t slot = 2; slot < start.slot_count(); ++slot) {
        const auto every = search_for<EveryPosition>(start, slot);
        for (const auto& [target, gain] : every.offers) {
            ReinsertionTree tree = start;
            ReinsertionMoves moves(tree.slot_count());
            std::ranges::fill(moves.proposals, Reinsertion{});
            moves.proposals[slot] = {gain, target, Reinsertion::none};
            ASSERT_EQ(moves.make(tree, Locks::minimal, 1, token), 1U);
            refit(tree, token);
            EXPECT_NEAR(interior_area(start) - interior_area(tree), gain, 2e-5);
            lay_out_depth_first(tree, token);
            EXPECT_NEAR(interior_area(start) - interior_area(tree), gain, 2e-5);
        }
    }
}

/// Checks that the state of the optimiser is a tree over all leaves whose boxes are right.
void expect_valid(const ReinsertionTree& tree) {
    ASSERT_EQ(tree.parent(ReinsertionTree::root), ReinsertionTree::root);
    std::vector<std::uint8_t> leaves(tree.pairs.size(), 0);
    std::vector<std::uint32_t> waiting{ReinsertionTree::root};
    std::size_t slots = 0;
    while (!waiting.empty()) {
        const std::uint32_t slot = waiting.back();
        waiting.pop_back();
        ASSERT_LE(++slots, tree.slot_count() - 1);
        const std::uint32_t child = tree.child(slot);
        if (tree.is_leaf(child)) {
            ASSERT_EQ(leaves[child & ~ReinsertionTree::leaf_flag]++, 0);
            continue;
        }
        ASSERT_EQ(tree.parents[child], slot);
        const BoxPair united = unite_sides(tree.pairs[child].boxes());
        ASSERT_FALSE(differ(united, repeat(tree.pairs[slot / 2].boxes(), slot % 2))[0]);
        ASSERT_EQ(half_areas(united)[0], tree.half_area(slot));
        waiting.push_back(2 * child);
        waiting.push_back(2 * child + 1);
    }
    ASSERT_EQ(slots, tree.slot_count() - 1);
}

TEST(ReinsertionOptimiser, IsATreeAfterEveryIteration) {
    Token token;
    BuildLog log;
    const Stopwatch clock;
    for (const Mesh& mesh : {random_soup(2), random_soup(3), random_soup(4), random_soup(3000),
                             random_soup(1000, 1.0F), sphere(20), copies(500),
                             growing_chain(300, 1.3), flat(random_soup(1000))}) {
        const BinaryBvh base = build_base(mesh);
        for (const std::uint32_t sparsity : {1U, 7U}) {
            ReinsertionOptimiser optimiser(base, model, clock, token, log);
            for (std::uint32_t i = 1; i <= 40; ++i) {
                if (i / 10 % 2 == 0)
                    optimiser.climb(i, sparsity, 1 + int(i % 3), 0.01);
                else
                    optimiser.heat({.temperature = i % 2 == 0 ? 0.5F : 1e-4F,
                                    .prune_probability = 0.1F,
                                    .seed = 5,
                                    .iteration = i},
                                   sparsity, 1 + int(i % 3));
                ASSERT_NO_FATAL_FAILURE(expect_valid(optimiser.tree()));
            }
            EXPECT_NO_THROW(validate(optimiser.best(), mesh));
            EXPECT_NEAR(cost(optimiser.best(), model), optimiser.best_cost(),
                        1e-4 * optimiser.best_cost());
        }
    }
}

TEST(ReinsertionOptimiser, HeatingMakesTheTreeWorseAndClimbingBetter) {
    Token token;
    BuildLog log;
    const Stopwatch clock;
    const BinaryBvh base = build_base(random_soup(3000));
    ReinsertionOptimiser optimiser(base, model, clock, token, log);
    for (std::uint32_t i = 1; i <= 20; ++i) optimiser.climb(i, 1, 3, 0.01);
    const double climbed = optimiser.cost();
    EXPECT_LT(climbed, 0.95 * cost(base, model));
    for (std::uint32_t i = 21; i <= 25; ++i)
        optimiser.heat({.temperature = 0.5F, .prune_probability = 0.01F, .seed = 1, .iteration = i},
                       1, 1);
    EXPECT_GT(optimiser.cost(), climbed);
    EXPECT_GT(optimiser.moved(), 0U);
    EXPECT_LE(optimiser.best_cost(), climbed);
    for (std::uint32_t i = 26; i <= 40; ++i) optimiser.climb(i, 1, 3, 0.01);
    EXPECT_LT(optimiser.cost(), 1.02 * climbed);
}

}  // namespace
}  // namespace bvhlab
