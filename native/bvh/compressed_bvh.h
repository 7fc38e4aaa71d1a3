// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include "base/array.h"
#include "bvh/wide_node.h"

namespace bvhlab {

/// Interior node of a compressed 8-wide tree in the 80 bytes of Ylitie, Karras, Laine 2017
/// ("Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", section 3.1 and
/// figure 2): the boxes of its children on a grid of 256 planes along each axis, which begins at
/// `origin` and has steps of a power of two.
///
/// A child's place among the eight slots says from where it is met: a ray whose direction has the
/// signs s (bit 2, 1, 0: x, y, z is negative) does well to visit slots in falling order of
/// slot ^ s ^ 7 (section 3.2; octant_slots.h chooses them). So slots may be missing anywhere.
/// Interior children are consecutive nodes from `first_child`, in order of slots; so are the
/// references of the leaves, from `first_triangle`.
struct alignas(16) CompressedNode {
    float origin[3];
    std::uint8_t exponent[3];    ///< of the steps, biased by 127: the bits of 2^e are e << 23
    std::uint8_t interior_mask;  ///< bit i: slot i holds an interior node
    std::uint32_t first_child;
    std::uint32_t first_triangle;
    std::uint8_t meta[8];       ///< 0: missing; interior: 001 and 24 + slot in 5 bits; leaf: number
                                ///< of references (1 to 3) in unary, offset (0 to 23) in 5 bits
    std::uint8_t planes[6][8];  ///< lower x, y, z, upper x, y, z: multiples of the step

    static constexpr unsigned most_references = 3;  ///< of a leaf
    static constexpr unsigned first_interior = 24;  ///< in `meta`

    bool is_missing(unsigned slot) const { return meta[slot] == 0; }
    bool is_leaf(unsigned slot) const { return (meta[slot] & 31U) < first_interior; }

    /// Number of references of a leaf; 0 of a missing slot.
    std::uint32_t leaf_size(unsigned slot) const {
        return std::uint32_t(std::popcount(unsigned(meta[slot]) >> 5));
    }
    /// Of a leaf: its first reference.
    std::uint32_t leaf_triangle(unsigned slot) const { return first_triangle + (meta[slot] & 31U); }
    /// Of an interior child: its node.
    std::uint32_t child_node(unsigned slot) const {
        const unsigned before = interior_mask & ((1U << slot) - 1U);
        return first_child + std::uint32_t(std::popcount(before));
    }

    float step(int axis) const { return std::bit_cast<float>(std::uint32_t(exponent[axis]) << 23); }

    /// A plane as traversal decodes it. The product is exact: at most 8 bits times a power of two
    /// from 2^-126 to 2^120 (compress.h). So one rounding remains, with or without a fused
    /// multiply-add, and the plane is the same on every machine.
    float plane(int row, unsigned slot) const {
        const int axis = row % 3;
        return origin[axis] + float(planes[row][slot]) * step(axis);
    }

    Box box(unsigned slot) const {
        return {{plane(0, slot), plane(1, slot), plane(2, slot)},
                {plane(3, slot), plane(4, slot), plane(5, slot)}};
    }
};
static_assert(sizeof(CompressedNode) == 80);

/// A tree of compressed nodes, level by level, and original corners of its references: 40 bytes for
/// each, without unused lanes. nodes[0] is the root.
struct CompressedBvh {
    static constexpr unsigned branching = 8;

    /// Floats of a reference in `corners`.
    static constexpr std::size_t corner_floats = 9;
    /// Floats that stand unused behind the last corners, so that a leaf's rows can be read four
    /// floats at a time.
    static constexpr std::size_t corner_padding = 3;

    Array<CompressedNode> nodes;
    /// A leaf of n references from number f on has the 9 rows (corner a x, a y, a z, b x, ...) of n
    /// floats at corners[9 f]: SIMD lanes are references, as in a TriangleBlock, but none is
    /// unused.
    Array<float> corners;
    Array<std::uint32_t> triangles;  ///< by reference: the mesh's triangle

    /// Tests charged for a leaf (cost.h): its references, for there are no unused lanes.
    static std::size_t charged(std::size_t size) { return size; }

    std::size_t node_bytes() const { return nodes.size() * sizeof(CompressedNode); }
    std::size_t leaf_bytes() const {
        return corners.size() * sizeof(float) + triangles.size() * sizeof(std::uint32_t);
    }

    /// Node `index` as the full layout holds it: children first, in order of slots, with their
    /// decoded boxes. For whatever measures trees; a leaf's child is its first reference.
    WideNode<8> node(std::size_t index) const {
        const CompressedNode& compressed = nodes[index];
        WideNode<8> wide;
        unsigned count = 0;
        for (unsigned slot = 0; slot < 8; ++slot) {
            if (compressed.is_missing(slot)) continue;
            const bool leaf = compressed.is_leaf(slot);
            wide.set_child(count++, compressed.box(slot),
                           leaf ? compressed.leaf_triangle(slot) : compressed.child_node(slot),
                           leaf ? compressed.leaf_size(slot) : 0);
        }
        while (count < 8) wide.set_missing(count++);
        return wide;
    }

    /// Triangle of reference i of the leaf whose child is `leaf`.
    std::uint32_t reference(std::uint32_t leaf, std::uint32_t i) const {
        return triangles[leaf + i];
    }
};

}  // namespace bvhlab
