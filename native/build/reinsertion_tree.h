// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "base/array.h"
#include "base/token.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"

namespace bvhlab {

/// Four floats, a language extension of GCC and Clang: one instruction per operation on every
/// 64-bit processor.
using Floats = float __attribute__((vector_size(16)));

/// Two boxes side by side. Upper bounds are negated, so that a union is three minima; areas are
/// not changed by that, since only products of two extents enter them.
struct BoxPair {
    Floats lower_xy;          ///< x0, x1, y0, y1
    Floats negated_upper_xy;  ///< the same of the upper corners, negated
    Floats z;                 ///< lower z0, z1, then negated upper z0, z1
};

inline Floats least(Floats a, Floats b) {
    return a < b ? a : b;
}

inline BoxPair unite(const BoxPair& a, const BoxPair& b) {
    return {least(a.lower_xy, b.lower_xy), least(a.negated_upper_xy, b.negated_upper_xy),
            least(a.z, b.z)};
}

/// Half the surface areas of both boxes, in lanes 0 and 1.
inline Floats half_areas(const BoxPair& boxes) {
    const Floats xy = boxes.lower_xy + boxes.negated_upper_xy;  // negated extents
    const Floats y = __builtin_shufflevector(xy, xy, 2, 3, 2, 3);
    const Floats z = boxes.z + __builtin_shufflevector(boxes.z, boxes.z, 2, 3, 2, 3);
    return xy * y + z * (xy + y);
}

/// The box of one side on both sides.
inline BoxPair repeat(const BoxPair& boxes, std::uint32_t side) {
    const auto pick = [side](Floats v) {
        return side == 0 ? __builtin_shufflevector(v, v, 0, 0, 2, 2)
                         : __builtin_shufflevector(v, v, 1, 1, 3, 3);
    };
    return {pick(boxes.lower_xy), pick(boxes.negated_upper_xy), pick(boxes.z)};
}

inline BoxPair swap_sides(const BoxPair& boxes) {
    const auto swap = [](Floats v) { return __builtin_shufflevector(v, v, 1, 0, 3, 2); };
    return {swap(boxes.lower_xy), swap(boxes.negated_upper_xy), swap(boxes.z)};
}

/// The union of both boxes on both sides.
inline BoxPair unite_sides(const BoxPair& boxes) {
    return unite(boxes, swap_sides(boxes));
}

/// On which sides two pairs have different boxes.
inline std::array<bool, 2> differ(const BoxPair& a, const BoxPair& b) {
    const auto lanes =
        (a.lower_xy != b.lower_xy) | (a.negated_upper_xy != b.negated_upper_xy) | (a.z != b.z);
    return {(lanes[0] | lanes[2]) != 0, (lanes[1] | lanes[3]) != 0};
}

/// The two children of one interior node: one cache line, as a search always tests both.
struct alignas(64) SlotPair {
    float lower_xy[4], negated_upper_xy[4], z[4];  ///< as in BoxPair
    float half_area[2];
    std::uint32_t child[2];  ///< pair of the node's children, or leaf_flag + leaf number

    BoxPair boxes() const {
        BoxPair boxes;
        std::memcpy(&boxes, this, sizeof boxes);
        return boxes;
    }

    /// Writes one side and nothing of the other, which another thread may be writing.
    void set_box(std::uint32_t side, const BoxPair& repeated) {
        for (const std::uint32_t lane : {side, side + 2}) {
            lower_xy[lane] = repeated.lower_xy[lane];
            negated_upper_xy[lane] = repeated.negated_upper_xy[lane];
            z[lane] = repeated.z[lane];
        }
        half_area[side] = half_areas(repeated)[0];
    }

    void copy_box(std::uint32_t side, const SlotPair& from, std::uint32_t from_side) {
        for (const std::uint32_t lane : {0U, 2U}) {
            lower_xy[lane + side] = from.lower_xy[lane + from_side];
            negated_upper_xy[lane + side] = from.negated_upper_xy[lane + from_side];
            z[lane + side] = from.z[lane + from_side];
        }
        half_area[side] = from.half_area[from_side];
    }
};

/// A binary BVH as the reinsertion builders work on it.
///
/// Nodes live in *slots*; the slots 2i and 2i + 1 of pair i are siblings. The root is slot 0 (slot
/// 1 is not used), its children are in pair 1. A reinsertion changes what is in which slot; parents
/// are stored by pair. Coordinates are scaled and moved so that the scene's longest side is 1 and
/// its lower corner 0 (the paper's units of temperature, and float is enough for any scene).
struct ReinsertionTree {
    static constexpr std::uint32_t leaf_flag = 0x80000000U;
    static constexpr std::uint32_t root = 0;

    Array<SlotPair> pairs;         ///< as many as leaves
    Array<std::uint32_t> parents;  ///< by pair, the slot of the parent

    std::size_t slot_count() const { return 2 * pairs.size(); }
    static bool is_leaf(std::uint32_t child) { return (child & leaf_flag) != 0; }
    static std::uint32_t sibling(std::uint32_t slot) { return slot ^ 1U; }
    std::uint32_t child(std::uint32_t slot) const { return pairs[slot / 2].child[slot % 2]; }
    float half_area(std::uint32_t slot) const { return pairs[slot / 2].half_area[slot % 2]; }
    std::uint32_t parent(std::uint32_t slot) const { return parents[slot / 2]; }

    /// Puts the node of one slot into another. Touches only these two sides of their pairs.
    void move_node(std::uint32_t from, std::uint32_t to) {
        pairs[to / 2].copy_box(to % 2, pairs[from / 2], from % 2);
        set_child(to, child(from));
    }

    /// Makes `child`, a leaf or a pair, what is below a slot.
    void set_child(std::uint32_t slot, std::uint32_t child) {
        pairs[slot / 2].child[slot % 2] = child;
        if (!is_leaf(child)) parents[child] = slot;
    }
};

/// A tree to work on. Throws Cancelled.
ReinsertionTree reinsertion_tree(const BinaryBvh& bvh, const Token& token);

/// Recomputes the boxes and areas of all interior nodes. Throws Cancelled.
void refit(ReinsertionTree& tree, const Token& token);

/// Moves the pairs into depth-first order, so that searches touch little memory. Throws Cancelled.
void lay_out_depth_first(ReinsertionTree& tree, const Token& token);

/// Eq. 2 with one reference per leaf, summed in double in an order that is always the same. Throws
/// Cancelled.
double cost(const ReinsertionTree& tree, const CostModel& model, const Token& token);

/// What is a child of what: the state of a tree without its boxes.
struct Topology {
    Array<std::uint32_t> children;  ///< SlotPair::child by slot
};

/// Copies the topology into `topology`, whose memory is used again. Throws Cancelled.
void save(const ReinsertionTree& tree, Topology& topology, const Token& token);

/// The tree with that topology over the leaves of `base`, in depth-first order, its boxes made from
/// the original leaf boxes. Throws Cancelled.
BinaryBvh binary_bvh(const Topology& topology, const BinaryBvh& base, const Token& token);

}  // namespace bvhlab
