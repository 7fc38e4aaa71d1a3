// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <variant>

#include "base/array.h"
#include "bvh/compressed_bvh.h"
#include "bvh/cost.h"
#include "bvh/transform_cache.h"
#include "bvh/wide_node.h"
#include "scene/mesh.h"

namespace bvhlab {

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

    /// Tests charged for a leaf of `size` references.
    static std::size_t charged(std::size_t size) { return charged_tests(size, K); }

    std::size_t node_bytes() const { return nodes.size() * sizeof(nodes[0]); }
    std::size_t leaf_bytes() const { return blocks.size() * sizeof(blocks[0]); }

    // What CompressedBvh has too, for whatever measures trees.
    const WideNode<K>& node(std::size_t index) const { return nodes[index]; }
    /// Triangle of reference i of the leaf whose child is `leaf`.
    std::uint32_t reference(std::uint32_t leaf, std::uint32_t i) const {
        return blocks[leaf + i / lanes].triangle[i % lanes];
    }
};

/// How nodes are stored.
enum class NodeLayout { full, cwbvh };
inline constexpr std::array<const char*, 2> node_layout_names = {"full", "cwbvh"};

/// The tree that rays traverse. The root is always an interior node, so a single leaf is its one
/// child.
struct Bvh {
    std::shared_ptr<const Mesh> mesh;
    std::variant<WideBvh<2>, WideBvh<4>, WideBvh<8>, CompressedBvh> tree;

    std::size_t reference_count = 0;
    std::size_t leaf_count = 0;
    std::size_t max_leaf_size = 0;
    std::size_t max_depth = 0;  ///< interior nodes on the longest way from root to leaf

    /// Shared by copies: whoever changes `tree` takes a new one.
    std::shared_ptr<TransformCache> transforms = std::make_shared<TransformCache>();

    unsigned branching() const {
        return std::visit([](const auto& wide) { return wide.branching; }, tree);
    }
    NodeLayout layout() const {
        return std::holds_alternative<CompressedBvh>(tree) ? NodeLayout::cwbvh : NodeLayout::full;
    }
    std::size_t interior_count() const {
        return std::visit([](const auto& wide) { return wide.nodes.size(); }, tree);
    }
    std::size_t node_bytes() const {
        return std::visit([](const auto& wide) { return wide.node_bytes(); }, tree);
    }
    std::size_t leaf_bytes() const {
        return std::visit([](const auto& wide) { return wide.leaf_bytes(); }, tree);
    }
};

}  // namespace bvhlab
