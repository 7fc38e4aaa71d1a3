// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/array.h"
#include "base/parallel.h"
#include "bvh/layout.h"

namespace bvhlab {

/// The children of one wide node, as binary nodes: from left to right, or in order of slots.
template <unsigned K>
struct Opened {
    std::array<std::uint32_t, K> child;
    std::array<bool, K> is_leaf;
    std::uint8_t slots = 0;  ///< compressed nodes: the slots that the children take, in order
    std::uint8_t count = 0;
};

/// Where the children of a wide node go: sums over the nodes before it.
struct Place {
    std::uint32_t interior = 0, block = 0, leaf = 0, reference = 0, largest_leaf = 0;
};

/// Reads the plans top-down, one level at a time, to find each node's children and where they go.
/// Then all nodes and leaves can be filled at once, in any order.
///
/// Leaves take blocks of `Lanes` references. `arrange(Opened<K>&)` puts the children of a node in
/// order.
template <unsigned K, unsigned Lanes, class Arrange>
class LevelOrder {
public:
    LevelOrder(const BinaryBvh& binary, const Array<Plan<K>>& plans, Arrange arrange, Token& token)
        : binary_(binary), plans_(plans), arrange_(arrange), token_(token) {
        end.interior = 1;
        std::vector<std::uint32_t> level{0};  // binary node of each wide node of the level
        while (!level.empty()) {
            ++depth;
            level = open_level(level);
        }
    }

    Array<Opened<K>> opened;  ///< by wide node
    Array<Place> places;      ///< of its children
    Place end;                ///< of the whole tree
    std::size_t depth = 0;    ///< levels

    /// References below a binary node.
    std::uint32_t size(std::uint32_t node) const {
        return binary_.is_leaf(node) ? 1 : plans_[node].size;
    }

    /// Asks for what filling node i will copy: its children lie anywhere in memory.
    void prefetch(std::size_t i, const Mesh& mesh) const {
        if (i >= opened.size()) return;
        for (unsigned c = 0; c < opened[i].count; ++c) {
            const std::uint32_t child = opened[i].child[c];
            __builtin_prefetch(&binary_.boxes[child]);
            if (binary_.is_leaf(child))
                __builtin_prefetch(&mesh.triangles[binary_.reference(child)]);
            else
                __builtin_prefetch(&binary_.children[child]);
        }
    }

    /// Calls `visit(triangle)` for every reference below `subtree`, depth-first. `pending` is
    /// working memory.
    template <class Visit>
    void for_each_reference(std::uint32_t subtree, std::vector<std::uint32_t>& pending,
                            Visit&& visit) const {
        for (std::uint32_t node = subtree;;) {
            while (!binary_.is_leaf(node)) {
                pending.push_back(binary_.children[node].right);
                node = binary_.children[node].left;
            }
            visit(binary_.reference(node));
            if (pending.empty()) return;
            node = pending.back();
            pending.pop_back();
        }
    }

    /// Fills all nodes: calls `fill(i, pending)` for each, in parallel, having asked for what it
    /// reads.
    template <class Fill>
    void for_each_node(const Mesh& mesh, Fill&& fill) const {
        constexpr std::size_t prefetch_distance = 4;  // nodes
        const std::size_t tasks = (opened.size() + grain - 1) / grain;
        parallel_for_each(tasks, 1, token_, [&](std::size_t task) {
            std::vector<std::uint32_t> pending;  // of the leaf at hand
            for (std::size_t i = task * grain; i < std::min(opened.size(), (task + 1) * grain);
                 ++i) {
                prefetch(i + prefetch_distance, mesh);
                fill(i, pending);
            }
        });
    }

    /// Sets all of `bvh` but its mesh and tree.
    void describe(Bvh& bvh) const {
        bvh.max_depth = depth;
        bvh.leaf_count = end.leaf;
        bvh.reference_count = end.reference;
        bvh.max_leaf_size = end.largest_leaf;
    }

private:
    static constexpr std::size_t grain = 256;

    /// Represents `node` by at most `trees` children of `opened`, as planned.
    void open(std::uint32_t node, unsigned trees, Opened<K>& wide) const {
        if (!binary_.is_leaf(node)) {
            const Plan<K>& plan = plans_[node];
            while (plan.left_share[trees] == Plan<K>::fewer) --trees;
            if (trees > 1) return open_children(node, plan.left_share[trees], trees, wide);
        }
        wide.child[wide.count] = node;
        wide.is_leaf[wide.count] =
            binary_.is_leaf(node) || plans_[node].left_share[1] == Plan<K>::leaf;
        ++wide.count;
    }

    void open_children(std::uint32_t node, unsigned left_share, unsigned trees,
                       Opened<K>& wide) const {
        const auto [left, right] = binary_.children[node];
        open(left, left_share, wide);
        open(right, trees - left_share, wide);
    }

    Opened<K> open_wide_node(std::uint32_t node) const {
        Opened<K> wide;
        if (binary_.is_leaf(node))  // a tree of a single reference
            open(node, 1, wide);
        else
            open_children(node, plans_[node].node_share, K, wide);
        arrange_(wide);
        return wide;
    }

    Place extent(const Opened<K>& wide) const {
        Place place;
        for (unsigned i = 0; i < wide.count; ++i) {
            if (!wide.is_leaf[i]) {
                ++place.interior;
                continue;
            }
            const std::uint32_t references = size(wide.child[i]);
            ++place.leaf;
            place.block += (references + Lanes - 1) / Lanes;
            place.reference += references;
            place.largest_leaf = std::max(place.largest_leaf, references);
        }
        return place;
    }

    /// Opens the wide nodes of one level and places their children behind `end`. Returns the binary
    /// nodes of the next level.
    std::vector<std::uint32_t> open_level(const std::vector<std::uint32_t>& level) {
        const std::size_t first = opened.size();
        const std::uint32_t next_level = end.interior;
        opened.resize(first + level.size());
        places.resize(first + level.size());
        parallel_for_each(level.size(), grain, token_, [&](std::size_t i) {
            opened[first + i] = open_wide_node(level[i]);
            places[first + i] = extent(opened[first + i]);
        });

        // Turn extents into places by an exclusive sum.
        std::vector<std::uint32_t> next;
        for (std::size_t i = first; i < opened.size(); ++i) {
            const Place extent = std::exchange(places[i], end);
            end.interior += extent.interior;
            end.block += extent.block;
            end.leaf += extent.leaf;
            end.reference += extent.reference;
            end.largest_leaf = std::max(end.largest_leaf, extent.largest_leaf);
        }
        next.reserve(end.interior - next_level);
        for (std::size_t i = first; i < opened.size(); ++i)
            for (unsigned c = 0; c < opened[i].count; ++c)
                if (!opened[i].is_leaf[c]) next.push_back(opened[i].child[c]);
        return next;
    }

    const BinaryBvh& binary_;
    const Array<Plan<K>>& plans_;
    Arrange arrange_;
    Token& token_;
};

}  // namespace bvhlab
