// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/depth_first.h"

#include <vector>

#include "base/parallel.h"
#include "bvh/leaf_first_order.h"

namespace bvhlab {
namespace {

/// A node and its place in the new order: the first interior node and the first leaf of its
/// subtree. A subtree of m leaves takes m - 1 interior nodes and m leaves in a row.
struct Place {
    std::uint32_t node, first_node, first_leaf;
};

class Renumbering {
public:
    Renumbering(const BinaryBvh& bvh, const Token& token)
        : old_(bvh),
          token_(token),
          leaves_(bvh.children.size()),
          new_(BinaryBvh::with_references(bvh.reference_count())) {
        for_each_leaf_first(old_, token_, [&](std::uint32_t node) {
            const auto [left, right] = old_.children[node];
            leaves_[node] = leaf_count(left) + leaf_count(right);
        });
    }

    BinaryBvh run() {
        // Place the top of the tree breadth-first until there are enough subtrees to share out.
        constexpr std::size_t subtrees_wanted = 512;
        std::vector<Place> top{{0, 0, 0}};
        std::size_t placed = 0;
        while (placed < top.size() && top.size() - placed < subtrees_wanted) {
            token_.check();
            place(Place(top[placed++]), top);
        }
        parallel_for_each(top.size() - placed, 1, token_,
                          [&](std::size_t i) { place_subtree(top[placed + i]); });
        return std::move(new_);
    }

private:
    std::uint32_t leaf_count(std::uint32_t node) const {
        return old_.is_leaf(node) ? 1 : leaves_[node];
    }

    std::uint32_t new_number(const Place& place) const {
        return old_.is_leaf(place.node) ? old_.first_leaf() + place.first_leaf : place.first_node;
    }

    /// Writes one node and appends the places of its children, the left one last.
    void place(const Place& place, std::vector<Place>& pending) {
        const std::uint32_t number = new_number(place);
        new_.boxes[number] = old_.boxes[place.node];
        if (old_.is_leaf(place.node)) {
            new_.references[place.first_leaf] = old_.reference(place.node);
            return;
        }
        const auto [left, right] = old_.children[place.node];
        const std::uint32_t left_leaves = leaf_count(left);
        const Place left_place{left, place.first_node + 1, place.first_leaf};
        const Place right_place{right, place.first_node + left_leaves,
                                place.first_leaf + left_leaves};
        new_.children[number] = {new_number(left_place), new_number(right_place)};
        pending.push_back(right_place);
        pending.push_back(left_place);
    }

    void place_subtree(const Place& root) {
        std::vector<Place> pending{root};
        for (std::size_t steps = 1; !pending.empty(); ++steps) {
            if (steps % 65536 == 0) token_.check();
            const Place next = pending.back();
            pending.pop_back();
            place(next, pending);
        }
    }

    const BinaryBvh& old_;
    const Token& token_;
    Array<std::uint32_t> leaves_;  // by interior node
    BinaryBvh new_;
};

}  // namespace

BinaryBvh depth_first(const BinaryBvh& bvh, const Token& token) {
    return Renumbering(bvh, token).run();
}

}  // namespace bvhlab
