// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/array.h"
#include "scene/box.h"

namespace bvhlab {

/// References of a tree at most: the numbers of its 2n - 1 nodes fit in 32 bits, and so do twice
/// the numbers of the interior ones, which reinsertion uses.
inline constexpr std::size_t most_references = std::size_t(1) << 31;

/// The tree that every builder returns: binary, one reference per leaf.
///
/// With n references there are 2n - 1 nodes: interior nodes 0 .. n-2, leaves n-1 .. 2n-2, root 0.
/// Leaf node n-1+i holds references[i]. Leaves may stand in any order; a spatial split makes
/// several references to one triangle, each with the box of its part.
struct BinaryBvh {
    struct Children {
        std::uint32_t left, right;
    };

    Array<Box> boxes;                 ///< 2n - 1, by node
    Array<Children> children;         ///< n - 1, by interior node
    Array<std::uint32_t> references;  ///< n triangle indices, by leaf

    std::size_t reference_count() const { return references.size(); }
    std::size_t node_count() const { return boxes.size(); }
    std::uint32_t first_leaf() const { return std::uint32_t(children.size()); }
    bool is_leaf(std::uint32_t node) const { return node >= first_leaf(); }
    std::uint32_t reference(std::uint32_t leaf) const { return references[leaf - first_leaf()]; }

    static BinaryBvh with_references(std::size_t count) {
        return {Array<Box>(2 * count - 1), Array<Children>(count - 1), Array<std::uint32_t>(count)};
    }
};

}  // namespace bvhlab
