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

/// Reads the plans top-down and fills nodes and blocks, one level at a time.
template <unsigned K>
class Layout {
public:
    Layout(const BinaryBvh& binary, const Array<Plan<K>>& plans, const Mesh& mesh, Token& token)
        : binary_(binary), plans_(plans), mesh_(mesh), token_(token) {}

    void run(Bvh& bvh) {
        auto& wide = bvh.tree.template emplace<WideBvh<K>>();
        std::vector<std::uint32_t> level{0};  // binary node of each wide node of the level
        while (!level.empty()) {
            ++bvh.max_depth;
            level = lay_out_level(level, wide, bvh);
        }
    }

private:
    static constexpr unsigned lanes = block_lanes<K>;

    /// Where the children of a wide node go: sums over the nodes before it in the level.
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

    /// Turns extents into places by an exclusive sum from `start`; returns the end.
    static Place accumulate(std::vector<Place>& extents, Place start) {
        for (Place& extent : extents) {
            const Place here = start;
            start.interior += extent.interior;
            start.block += extent.block;
            start.leaf += extent.leaf;
            start.reference += extent.reference;
            start.largest_leaf = std::max(start.largest_leaf, extent.largest_leaf);
            extent = here;
        }
        return start;
    }

    std::vector<std::uint32_t> lay_out_level(const std::vector<std::uint32_t>& level,
                                             WideBvh<K>& wide, Bvh& bvh) {
        constexpr std::size_t grain = 256;
        const std::size_t first_node = wide.nodes.size();
        const std::size_t next_level = first_node + level.size();

        std::vector<Opened<K>> opened(level.size());
        std::vector<Place> places(level.size());
        parallel_for_each(level.size(), grain, token_, [&](std::size_t i) {
            opened[i] = open_wide_node(level[i]);
            places[i] = extent(opened[i]);
        });
        const Place end = accumulate(places, {0, std::uint32_t(wide.blocks.size()), 0, 0, 0});

        wide.nodes.resize(next_level);
        wide.blocks.resize(end.block);
        std::vector<std::uint32_t> next(end.interior);
        parallel_for_each(level.size(), grain, token_, [&](std::size_t i) {
            Place place = places[i];
            WideNode<K>& node = wide.nodes[first_node + i];
            clear(node);
            for (unsigned c = 0; c < opened[i].count; ++c) {
                const std::uint32_t child = opened[i].child[c];
                node.set_box(c, binary_.boxes[child]);
                if (opened[i].is_leaf[c]) {
                    node.child[c] = place.block;
                    node.count[c] = size(child);
                    fill_blocks(child, wide.blocks.data() + place.block);
                    place.block += (node.count[c] + lanes - 1) / lanes;
                } else {
                    node.child[c] = std::uint32_t(next_level) + place.interior;
                    node.count[c] = 0;
                    next[place.interior++] = child;
                }
            }
        });
        bvh.leaf_count += end.leaf;
        bvh.reference_count += end.reference;
        bvh.max_leaf_size = std::max<std::size_t>(bvh.max_leaf_size, end.largest_leaf);
        return next;
    }

    static void clear(WideNode<K>& node) {
        for (unsigned c = 0; c < K; ++c) {
            node.set_box(c, Box::empty());
            node.child[c] = 0;
            node.count[c] = 0;
        }
    }

    /// Copies the triangles below `subtree`, depth-first, into consecutive blocks.
    void fill_blocks(std::uint32_t subtree, TriangleBlock<lanes>* blocks) const {
        std::uint32_t filled = 0;
        std::uint32_t last = no_triangle;
        std::vector<std::uint32_t> pending;  // only larger leaves need it
        for (std::uint32_t node = subtree;;) {
            while (!binary_.is_leaf(node)) {
                pending.push_back(binary_.children[node].right);
                node = binary_.children[node].left;
            }
            last = binary_.reference(node);
            set_lane(blocks[filled / lanes], filled % lanes, last, last);
            ++filled;
            if (pending.empty()) break;
            node = pending.back();
            pending.pop_back();
        }
        for (; filled % lanes != 0; ++filled)
            set_lane(blocks[filled / lanes], filled % lanes, last, no_triangle);
    }

    void set_lane(TriangleBlock<lanes>& block, unsigned lane, std::uint32_t corners_of,
                  std::uint32_t index) const {
        const Triangle triangle = mesh_.triangle(corners_of);
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
