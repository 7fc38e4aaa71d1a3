// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/reinsertion_tree.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <vector>

#include "base/parallel.h"
#include "bvh/depth_first.h"
#include "bvh/leaf_first_order.h"

namespace bvhlab {
namespace {

constexpr std::size_t grain = 2048;

/// Maps the scene to lower corner 0 and longest side 1, in double: scenes may be of any scale.
class UnitScale {
public:
    explicit UnitScale(const Box& scene) : origin_(scene.lower) {
        double longest = 0.0;
        for (int axis = 0; axis < 3; ++axis)
            longest = std::max(longest, double(scene.upper[axis]) - double(scene.lower[axis]));
        scale_ = longest > 0.0 ? 1.0 / longest : 1.0;
    }

    BoxPair repeated(const Box& box) const {
        const auto at = [&](const glm::vec3& corner, int axis) {
            return float((double(corner[axis]) - double(origin_[axis])) * scale_);
        };
        const float x = at(box.lower, 0), y = at(box.lower, 1), z = at(box.lower, 2);
        const float X = -at(box.upper, 0), Y = -at(box.upper, 1), Z = -at(box.upper, 2);
        return {Floats{x, x, y, y}, Floats{X, X, Y, Y}, Floats{z, z, Z, Z}};
    }

private:
    glm::vec3 origin_;
    double scale_;
};

/// Calls `visit(pair, slot)` for every pair of children and the slot of their parent, each after
/// the pairs below it, in parallel: whoever comes to a pair second goes on upwards.
template <class Visit>
void for_each_pair_upwards(const ReinsertionTree& tree, const Token& token, Visit&& visit) {
    const std::size_t count = tree.pairs.size();
    Array<std::uint8_t> arrivals(count);
    const auto leaves = [&](std::size_t pair) {
        const auto& child = tree.pairs[pair].child;
        return int(tree.is_leaf(child[0])) + int(tree.is_leaf(child[1]));
    };
    parallel_for_each(count, grain, token,
                      [&](std::size_t pair) { arrivals[pair] = std::uint8_t(leaves(pair)); });
    parallel_for_each(count, grain, token, [&](std::size_t start) {
        if (start == 0 || leaves(start) < 2) return;
        for (std::uint32_t pair = std::uint32_t(start);;) {
            const std::uint32_t slot = tree.parents[pair];
            visit(pair, slot);
            if (slot == ReinsertionTree::root) return;
            pair = slot / 2;
            const std::atomic_ref<std::uint8_t> arrived(arrivals[pair]);
            if (arrived.fetch_add(1, std::memory_order_acq_rel) == 0) return;
        }
    });
}

/// Copies the pairs of a tree to their places in depth-first order.
class DepthFirstLayout {
public:
    DepthFirstLayout(const ReinsertionTree& tree, const Token& token)
        : old_(tree), token_(token), sizes_(tree.pairs.size()) {
        for_each_pair_upwards(old_, token_, [&](std::uint32_t pair, std::uint32_t) {
            const auto& child = old_.pairs[pair].child;
            sizes_[pair] = 1 + size(child[0]) + size(child[1]);
        });
        new_.pairs.resize(old_.pairs.size());
        new_.parents.resize(old_.parents.size());
    }

    ReinsertionTree run() {
        new_.pairs[0] = old_.pairs[0];
        new_.parents[0] = ReinsertionTree::root;
        if (old_.is_leaf(old_.child(ReinsertionTree::root))) return std::move(new_);
        constexpr std::size_t subtrees_wanted = 512;
        std::vector<Place> top{{old_.child(ReinsertionTree::root), 1, ReinsertionTree::root}};
        std::size_t placed = 0;
        while (placed < top.size() && top.size() - placed < subtrees_wanted)
            place(Place(top[placed++]), top);
        parallel_for_each(top.size() - placed, 1, token_, [&](std::size_t i) {
            std::vector<Place> pending{top[placed + i]};
            for (std::size_t steps = 1; !pending.empty(); ++steps) {
                if (steps % 65536 == 0) token_.check();
                const Place next = pending.back();
                pending.pop_back();
                place(next, pending);
            }
        });
        return std::move(new_);
    }

private:
    struct Place {
        std::uint32_t pair, new_pair, new_parent;
    };

    std::uint32_t size(std::uint32_t child) const {
        return ReinsertionTree::is_leaf(child) ? 0 : sizes_[child];
    }

    void place(const Place& place, std::vector<Place>& pending) {
        const SlotPair& pair = old_.pairs[place.pair];
        new_.pairs[place.new_pair] = pair;
        new_.pairs[place.new_parent / 2].child[place.new_parent % 2] = place.new_pair;
        new_.parents[place.new_pair] = place.new_parent;
        const std::uint32_t left = place.new_pair + 1, right = left + size(pair.child[0]);
        if (!old_.is_leaf(pair.child[1]))
            pending.push_back({pair.child[1], right, 2 * place.new_pair + 1});
        if (!old_.is_leaf(pair.child[0]))
            pending.push_back({pair.child[0], left, 2 * place.new_pair});
    }

    const ReinsertionTree& old_;
    const Token& token_;
    Array<std::uint32_t> sizes_;  // pairs in the subtree, by pair
    ReinsertionTree new_;
};

}  // namespace

ReinsertionTree reinsertion_tree(const BinaryBvh& bvh, const Token& token) {
    const UnitScale unit(bvh.boxes[0]);
    const std::uint32_t first_leaf = bvh.first_leaf();
    ReinsertionTree tree{Array<SlotPair>(bvh.reference_count()),
                         Array<std::uint32_t>(bvh.reference_count())};
    const auto put = [&](std::uint32_t slot, std::uint32_t node) {
        tree.set_child(
            slot, bvh.is_leaf(node) ? ReinsertionTree::leaf_flag | (node - first_leaf) : node + 1);
        tree.pairs[slot / 2].set_box(slot % 2, unit.repeated(bvh.boxes[node]));
    };
    put(1, 0);  // never looked at, but written
    put(0, 0);
    tree.parents[0] = ReinsertionTree::root;
    parallel_for_each(first_leaf, grain, token, [&](std::size_t node) {
        put(std::uint32_t(2 * node + 2), bvh.children[node].left);
        put(std::uint32_t(2 * node + 3), bvh.children[node].right);
    });
    return tree;
}

void refit(ReinsertionTree& tree, const Token& token) {
    for_each_pair_upwards(tree, token, [&](std::uint32_t pair, std::uint32_t slot) {
        tree.pairs[slot / 2].set_box(slot % 2, unite_sides(tree.pairs[pair].boxes()));
    });
}

void lay_out_depth_first(ReinsertionTree& tree, const Token& token) {
    tree = DepthFirstLayout(tree, token).run();
}

double cost(const ReinsertionTree& tree, const CostModel& model, const Token& token) {
    const auto weighted_area = [&](const SlotPair& pair, int side) {
        return double(pair.half_area[side]) *
               (tree.is_leaf(pair.child[side]) ? model.intersection : model.traversal);
    };
    const double root_area = tree.half_area(ReinsertionTree::root);
    if (root_area <= 0.0) return model.traversal;
    const auto sum = [&](const IndexRange& pairs, double areas) {
        token.check();
        for (std::size_t i = pairs.begin(); i < pairs.end(); ++i)
            areas += weighted_area(tree.pairs[i], 0) + weighted_area(tree.pairs[i], 1);
        return areas;
    };
    const double below_root = parallel_sum(1, tree.pairs.size(), grain, 0.0, sum);
    return (weighted_area(tree.pairs[0], 0) + below_root) / root_area;
}

void save(const ReinsertionTree& tree, Topology& topology, const Token& token) {
    topology.children.resize(tree.slot_count());
    parallel_for_each(tree.pairs.size(), grain, token, [&](std::size_t pair) {
        topology.children[2 * pair] = tree.pairs[pair].child[0];
        topology.children[2 * pair + 1] = tree.pairs[pair].child[1];
    });
}

BinaryBvh binary_bvh(const Topology& topology, const BinaryBvh& base, const Token& token) {
    BinaryBvh bvh = BinaryBvh::with_references(base.reference_count());
    const std::uint32_t first_leaf = bvh.first_leaf();
    parallel_for_each(base.reference_count(), grain, token, [&](std::size_t leaf) {
        bvh.references[leaf] = base.references[leaf];
        bvh.boxes[first_leaf + leaf] = base.boxes[first_leaf + leaf];
    });
    if (first_leaf == 0) return bvh;

    // Pair i becomes interior node i - 1, but the root's pair changes places with pair 1.
    const std::uint32_t root_pair = topology.children[ReinsertionTree::root];
    const auto trade = [&](std::uint32_t pair) {
        return pair == root_pair ? 1 : pair == 1 ? root_pair : pair;
    };
    const auto node = [&](std::uint32_t child) {
        return ReinsertionTree::is_leaf(child) ? first_leaf + (child & ~ReinsertionTree::leaf_flag)
                                               : trade(child) - 1;
    };
    parallel_for_each(first_leaf, grain, token, [&](std::size_t i) {
        const std::size_t slot = 2 * std::size_t(trade(std::uint32_t(i + 1)));
        bvh.children[i] = {node(topology.children[slot]), node(topology.children[slot + 1])};
    });
    for_each_leaf_first(bvh, token, [&](std::uint32_t i) {
        bvh.boxes[i] = unite(bvh.boxes[bvh.children[i].left], bvh.boxes[bvh.children[i].right]);
    });
    return depth_first(bvh, token);
}

}  // namespace bvhlab
