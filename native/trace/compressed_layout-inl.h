// SPDX-License-Identifier: GPL-3.0-or-later
// How traversal reads trees of compressed nodes (CompressedBvh), compiled once per SIMD target
// (Highway's -inl.h convention).
#if defined(BVHLAB_TRACE_COMPRESSED_LAYOUT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BVHLAB_TRACE_COMPRESSED_LAYOUT_INL_H_
#undef BVHLAB_TRACE_COMPRESSED_LAYOUT_INL_H_
#else
#define BVHLAB_TRACE_COMPRESSED_LAYOUT_INL_H_
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "bvh/compressed_bvh.h"
#include "trace/boxes-inl.h"
#include "trace/traverse.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The triangles of one leaf, for triangle tests. Lanes behind the last hold numbers of other rows.
struct LeafLanes {
    static constexpr unsigned count = 4;
    static_assert(count > CompressedNode::most_references &&
                  CompressedBvh::corner_padding >= count - 1);

    const CompressedBvh& tree;
    const TriangleTransforms* transforms;
    std::size_t first;   ///< reference
    std::uint32_t size;  ///< references

    template <class D>
    HWY_INLINE hn::Vec<D> corners(D d, int corner, int axis, unsigned i) const {
        return hn::LoadU(d, rows() + unsigned(3 * corner + axis) * size + i);
    }
    HWY_INLINE void corners(unsigned lane, float (&corners)[3][3]) const {
        for (unsigned corner = 0; corner < 3; ++corner)
            for (unsigned axis = 0; axis < 3; ++axis)
                corners[corner][axis] = rows()[(3 * corner + axis) * size + lane];
    }
    template <class D>
    HWY_INLINE hn::Vec<D> values(D d, unsigned k, unsigned i) const {
        const float* const row = transforms->values.data() + transforms->per_triangle * first;
        return hn::LoadU(d, row + k * size + i);
    }
    HWY_INLINE std::uint32_t triangle(unsigned lane) const { return tree.triangles[first + lane]; }

private:
    HWY_INLINE const float* rows() const {
        return tree.corners.data() + CompressedBvh::corner_floats * first;
    }
};

/// The decoded boxes contain the true ones (quantise.h) and go through the same box test as full
/// nodes, so the argument of intersect.h holds: hits are those of every other tree.
class CompressedLayout {
public:
    static constexpr unsigned width = 8;

    CompressedLayout(const CompressedBvh& tree, const TriangleTransforms* transforms)
        : tree_(tree), transforms_(transforms) {}

    StackEntry root(float t_min) const { return {t_min, 0, 0}; }
    HWY_INLINE bool is_leaf(const StackEntry& entry) const { return entry.count != 0; }

    HWY_INLINE const CompressedNode& node(const StackEntry& entry) const {
        return tree_.nodes[entry.child];
    }

    template <bool AnyHit, class Ray>
    HWY_INLINE static unsigned enter(const CompressedNode& node, const Ray& ray, float t_far,
                                     float* urgency) {
        // As CompressedNode::plane; the product is exact, so it may be fused.
        const auto planes = [&](auto d, int axis, int row, unsigned i) HWY_ATTR {
            const hn::Rebind<std::uint8_t, decltype(d)> bytes;
            const hn::Rebind<std::int32_t, decltype(d)> integers;
            const std::uint8_t* const multiples = node.planes[axis + (row & 1) * 3] + i;
            return hn::MulAdd(
                hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(bytes, multiples))),
                hn::Set(d, node.step(axis)), hn::Set(d, node.origin[axis]));
        };
        return enter_boxes<width, AnyHit>(planes, ray, t_far, urgency) & present(node);
    }

    /// Asks for what visiting the child will read: 8 % faster for any hit on crytek_sponza, 3 % for
    /// the closest.
    HWY_INLINE StackEntry child(const CompressedNode& node, unsigned slot, float urgency) const {
        // Without a branch: whether the next child is a leaf cannot be predicted.
        const bool leaf = node.is_leaf(slot);
        const std::uint32_t triangle = node.leaf_triangle(slot), child = node.child_node(slot);
        const auto* const rows = reinterpret_cast<const char*>(tree_.corners.data());
        const auto* const nodes = reinterpret_cast<const char*>(tree_.nodes.data());
        const std::size_t offset = leaf ? sizeof(float) * CompressedBvh::corner_floats * triangle
                                        : sizeof(CompressedNode) * std::size_t(child);
        __builtin_prefetch((leaf ? rows : nodes) + offset);
        return {urgency, leaf ? triangle : child, leaf ? node.leaf_size(slot) : 0};
    }

    static unsigned box_count(const CompressedNode& node) {
        return unsigned(std::popcount(present(node)));
    }

    unsigned triangle_count(const StackEntry& leaf) const { return leaf.count; }

    /// Calls visit(lanes, used) for the leaf's one block.
    template <class Visit>
    HWY_INLINE void for_each_block(const StackEntry& leaf, const Visit& visit) const {
        visit(LeafLanes{tree_, transforms_, leaf.child, leaf.count}, (1U << leaf.count) - 1U);
    }

private:
    /// Bit i set where slot i is not missing.
    HWY_INLINE static unsigned present(const CompressedNode& node) {
        const hn::CappedTag<std::uint8_t, 8> d;
        unsigned bits = 0;
        for (unsigned i = 0; i < 8; i += unsigned(hn::Lanes(d)))  // the baseline has one lane
            bits |= mask_bits(d, hn::Ne(hn::LoadU(d, node.meta + i), hn::Zero(d))) << i;
        return bits;
    }

    const CompressedBvh& tree_;
    const TriangleTransforms* transforms_;
};

inline CompressedLayout layout_of(const CompressedBvh& tree, const TriangleTransforms* transforms) {
    return {tree, transforms};
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#endif  // per target
