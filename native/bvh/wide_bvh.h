// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <variant>

#include "base/array.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Interior node of a k-ary tree, 32k bytes (paper section 3): the boxes of its children, one plane
/// of all children after the other so that SIMD lanes are children, and where each child is.
///
/// Children come first, missing ones last: an empty box (lower = +inf, upper = -inf), which no ray
/// enters, index 0 and count 0.
template <unsigned K>
struct alignas(32) WideNode {
    float planes[6][K];      ///< lower x, upper x, lower y, upper y, lower z, upper z
    std::uint32_t child[K];  ///< interior child: node index; leaf: its first triangle block
    std::uint32_t count[K];  ///< interior child: 0; leaf: number of references

    bool is_missing(unsigned i) const { return planes[0][i] > planes[1][i]; }
    bool is_leaf(unsigned i) const { return count[i] != 0; }

    Box box(unsigned i) const {
        return {{planes[0][i], planes[2][i], planes[4][i]},
                {planes[1][i], planes[3][i], planes[5][i]}};
    }
    void set_box(unsigned i, const Box& box) {
        for (int axis = 0; axis < 3; ++axis) {
            planes[2 * axis][i] = box.lower[axis];
            planes[2 * axis + 1][i] = box.upper[axis];
        }
    }
};
static_assert(sizeof(WideNode<2>) == 64 && sizeof(WideNode<4>) == 128 &&
              sizeof(WideNode<8>) == 256);

/// Lanes of a triangle block: leaves of wide trees are filled in multiples of k (Eq. 3); binary
/// trees take four, the narrowest SIMD width.
template <unsigned K>
inline constexpr unsigned block_lanes = K < 4 ? 4 : K;

/// Original corners of up to `Lanes` triangles of one leaf, lane by lane. Unused lanes repeat the
/// last triangle with index `no_triangle`.
template <unsigned Lanes>
struct alignas(32) TriangleBlock {
    float corners[3][3][Lanes];  ///< [corner a, b, c][axis][lane]
    std::uint32_t triangle[Lanes];
};

/// A tree of branching factor K in breadth-first layout; nodes[0] is the root.
template <unsigned K>
struct WideBvh {
    static constexpr unsigned branching = K;
    static constexpr unsigned lanes = block_lanes<K>;

    Array<WideNode<K>> nodes;
    Array<TriangleBlock<lanes>> blocks;
};

/// The tree that rays traverse. The root is always an interior node, so a single leaf is its one
/// child.
struct Bvh {
    std::shared_ptr<const Mesh> mesh;
    std::variant<WideBvh<2>, WideBvh<4>, WideBvh<8>> tree;

    std::size_t reference_count = 0;
    std::size_t leaf_count = 0;
    std::size_t max_leaf_size = 0;
    std::size_t max_depth = 0;  ///< interior nodes on the longest way from root to leaf

    unsigned branching() const {
        return std::visit([](const auto& wide) { return wide.branching; }, tree);
    }
    std::size_t interior_count() const {
        return std::visit([](const auto& wide) { return wide.nodes.size(); }, tree);
    }
    std::size_t node_bytes() const {
        return std::visit([](const auto& w) { return w.nodes.size() * sizeof(w.nodes[0]); }, tree);
    }
    std::size_t leaf_bytes() const {
        return std::visit([](const auto& w) { return w.blocks.size() * sizeof(w.blocks[0]); },
                          tree);
    }
};

}  // namespace bvhlab
