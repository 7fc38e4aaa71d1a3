// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/layout.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/parallel.h"

namespace bvhlab {
namespace {

/// The children of one wide node, as binary nodes from left to right.
template <unsigned K>
struct Opened {
    std::array<std::uint32_t, K> child;
    std::array<bool, K> is_leaf;
    unsigned count = 0;
};

/// Reads the plans top-down, one level at a time, to find each node's children and where they go;
/// then fills all nodes and blocks at once.
template <unsigned K>
class Layout {
public:
    Layout(const BinaryBvh& binary, const Array<Plan<K>>& plans, const Mesh& mesh, Token& token)
        : binary_(binary), plans_(plans), mesh_(mesh), token_(token) {}

    void run(Bvh& bvh) {
        Place end;  // of what is placed so far
        end.interior = 1;
        std::vector<std::uint32_t> level{0};  // binary node of each wide node of the level
        while (!level.empty()) {
            ++bvh.max_depth;
            level = open_level(level, end);
        }
        bvh.leaf_count = end.leaf;
        bvh.reference_count = end.reference;
        bvh.max_leaf_size = end.largest_leaf;

        auto& wide = bvh.tree.template emplace<WideBvh<K>>();
        wide.nodes.resize(opened_.size());
        wide.blocks.resize(end.block);
        const std::size_t tasks = (opened_.size() + grain - 1) / grain;
        parallel_for_each(tasks, 1, token_, [&](std::size_t task) {
            std::vector<std::uint32_t> pending;  // of the leaf at hand
            for (std::size_t i = task * grain; i < std::min(opened_.size(), (task + 1) * grain);
                 ++i) {
                prefetch(i + prefetch_distance);
                fill_node(wide.nodes[i], opened_[i], places_[i], wide.blocks.data(), pending);
            }
        });
    }

private:
    static constexpr std::size_t grain = 256;
    static constexpr std::size_t prefetch_distance = 4;  // nodes
    static constexpr unsigned lanes = block_lanes<K>;

    /// Where the children of a wide node go: sums over the nodes before it.
    struct Place {
        std::uint32_t interior = 0, block = 0, leaf = 0, reference = 0, largest_leaf = 0;
    };

    std::uint32_t size(std::uint32_t node) const {
        return binary_.is_leaf(node) ? 1 : plans_[node].size;
    }

    /// Represents `node` by at most `trees` children of `opened`, as planned.
    void open(std::uint32_t node, unsigned trees, Opened<K>& opened) const {
        if (!binary_.is_leaf(node)) {
            const Plan<K>& plan = plans_[node];
            while (plan.left_share[trees] == Plan<K>::fewer) --trees;
            if (trees > 1) return open_children(node, plan.left_share[trees], trees, opened);
        }
        opened.child[opened.count] = node;
        opened.is_leaf[opened.count] =
            binary_.is_leaf(node) || plans_[node].left_share[1] == Plan<K>::leaf;
        ++opened.count;
    }

    void open_children(std::uint32_t node, unsigned left_share, unsigned trees,
                       Opened<K>& opened) const {
        const auto [left, right] = binary_.children[node];
        open(left, left_share, opened);
        open(right, trees - left_share, opened);
    }

    Opened<K> open_wide_node(std::uint32_t node) const {
        Opened<K> opened;
        if (binary_.is_leaf(node))  // a tree of a single reference
            open(node, 1, opened);
        else
            open_children(node, plans_[node].node_share, K, opened);
        return opened;
    }

    Place extent(const Opened<K>& opened) const {
        Place place;
        for (unsigned i = 0; i < opened.count; ++i) {
            if (!opened.is_leaf[i]) {
                ++place.interior;
                continue;
            }
            const std::uint32_t references = size(opened.child[i]);
            ++place.leaf;
            place.block += (references + lanes - 1) / lanes;
            place.reference += references;
            place.largest_leaf = std::max(place.largest_leaf, references);
        }
        return place;
    }

    /// Opens the wide nodes of one level and places their children behind `end`. Returns the binary
    /// nodes of the next level.
    std::vector<std::uint32_t> open_level(const std::vector<std::uint32_t>& level, Place& end) {
        const std::size_t first = opened_.size();
        const std::uint32_t next_level = end.interior;
        opened_.resize(first + level.size());
        places_.resize(first + level.size());
        parallel_for_each(level.size(), grain, token_, [&](std::size_t i) {
            opened_[first + i] = open_wide_node(level[i]);
            places_[first + i] = extent(opened_[first + i]);
        });

        // Turn extents into places by an exclusive sum.
        std::vector<std::uint32_t> next;
        for (std::size_t i = first; i < opened_.size(); ++i) {
            const Place extent = std::exchange(places_[i], end);
            end.interior += extent.interior;
            end.block += extent.block;
            end.leaf += extent.leaf;
            end.reference += extent.reference;
            end.largest_leaf = std::max(end.largest_leaf, extent.largest_leaf);
        }
        next.reserve(end.interior - next_level);
        for (std::size_t i = first; i < opened_.size(); ++i)
            for (unsigned c = 0; c < opened_[i].count; ++c)
                if (!opened_[i].is_leaf[c]) next.push_back(opened_[i].child[c]);
        return next;
    }

    void fill_node(WideNode<K>& node, const Opened<K>& opened, Place place,
                   TriangleBlock<lanes>* blocks, std::vector<std::uint32_t>& pending) const {
        clear(node);
        for (unsigned c = 0; c < opened.count; ++c) {
            const std::uint32_t child = opened.child[c];
            node.set_box(c, binary_.boxes[child]);
            if (opened.is_leaf[c]) {
                node.child[c] = place.block;
                node.count[c] = size(child);
                fill_blocks(child, blocks + place.block, pending);
                place.block += (node.count[c] + lanes - 1) / lanes;
            } else {
                node.child[c] = place.interior++;
            }
        }
    }

    /// Asks for what the node will copy: its children lie anywhere in memory.
    void prefetch(std::size_t i) const {
        if (i >= opened_.size()) return;
        for (unsigned c = 0; c < opened_[i].count; ++c) {
            const std::uint32_t child = opened_[i].child[c];
            __builtin_prefetch(&binary_.boxes[child]);
            if (binary_.is_leaf(child))
                __builtin_prefetch(&mesh_.triangles[binary_.reference(child)]);
            else
                __builtin_prefetch(&binary_.children[child]);
        }
    }

    static void clear(WideNode<K>& node) {
        for (unsigned c = 0; c < K; ++c) {
            node.set_box(c, Box::empty());
            node.child[c] = 0;
            node.count[c] = 0;
        }
    }

    /// Copies the triangles below `subtree`, depth-first, into consecutive blocks.
    void fill_blocks(std::uint32_t subtree, TriangleBlock<lanes>* blocks,
                     std::vector<std::uint32_t>& pending) const {
        std::uint32_t filled = 0;
        Triangle triangle;
        for (std::uint32_t node = subtree;;) {
            while (!binary_.is_leaf(node)) {
                pending.push_back(binary_.children[node].right);
                node = binary_.children[node].left;
            }
            const std::uint32_t index = binary_.reference(node);
            triangle = mesh_.triangle(index);
            set_lane(blocks[filled / lanes], filled % lanes, triangle, index);
            ++filled;
            if (pending.empty()) break;
            node = pending.back();
            pending.pop_back();
        }
        for (; filled % lanes != 0; ++filled)
            set_lane(blocks[filled / lanes], filled % lanes, triangle, no_triangle);
    }

    static void set_lane(TriangleBlock<lanes>& block, unsigned lane, const Triangle& triangle,
                         std::uint32_t index) {
        const glm::vec3* corners[3] = {&triangle.a, &triangle.b, &triangle.c};
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis)
                block.corners[corner][axis][lane] = (*corners[corner])[axis];
        block.triangle[lane] = index;
    }

    const BinaryBvh& binary_;
    const Array<Plan<K>>& plans_;
    const Mesh& mesh_;
    Token& token_;
    Array<Opened<K>> opened_;  // by wide node
    Array<Place> places_;      // of its children
};

}  // namespace

template <unsigned K>
Bvh breadth_first_layout(const BinaryBvh& binary, const Array<Plan<K>>& plans,
                         std::shared_ptr<const Mesh> mesh, Token& token) {
    Bvh bvh;
    Layout<K>(binary, plans, *mesh, token).run(bvh);
    bvh.mesh = std::move(mesh);
    token.advance(1.0F);
    return bvh;
}

template Bvh breadth_first_layout<2>(const BinaryBvh&, const Array<Plan<2>>&,
                                     std::shared_ptr<const Mesh>, Token&);
template Bvh breadth_first_layout<4>(const BinaryBvh&, const Array<Plan<4>>&,
                                     std::shared_ptr<const Mesh>, Token&);
template Bvh breadth_first_layout<8>(const BinaryBvh&, const Array<Plan<8>>&,
                                     std::shared_ptr<const Mesh>, Token&);

}  // namespace bvhlab
