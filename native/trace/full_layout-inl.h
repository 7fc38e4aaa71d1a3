// SPDX-License-Identifier: GPL-3.0-or-later
// How traversal reads trees of full nodes (WideBvh), compiled once per SIMD target (Highway's
// -inl.h convention).
#if defined(BVHLAB_TRACE_FULL_LAYOUT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BVHLAB_TRACE_FULL_LAYOUT_INL_H_
#undef BVHLAB_TRACE_FULL_LAYOUT_INL_H_
#else
#define BVHLAB_TRACE_FULL_LAYOUT_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>

#include "bvh/wide_bvh.h"
#include "trace/boxes-inl.h"
#include "trace/traverse.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The triangles of block number `index`, for triangle tests.
template <unsigned Lanes>
struct BlockLanes {
    static constexpr unsigned count = Lanes;

    const TriangleBlock<Lanes>& block;
    std::size_t index;
    const TriangleTransforms* transforms;

    template <class D>
    HWY_INLINE hn::Vec<D> corners(D d, int corner, int axis, unsigned i) const {
        return hn::Load(d, block.corners[corner][axis] + i);
    }
    HWY_INLINE void corners(unsigned lane, float (&corners)[3][3]) const {
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis)
                corners[corner][axis] = block.corners[corner][axis][lane];
    }
    template <class D>
    HWY_INLINE hn::Vec<D> values(D d, unsigned k, unsigned i) const {
        const std::size_t row = index * transforms->per_triangle + k;
        return hn::Load(d, transforms->values.data() + row * Lanes + i);
    }
    HWY_INLINE std::uint32_t triangle(unsigned lane) const { return block.triangle[lane]; }
};

template <unsigned K>
class FullLayout {
public:
    static constexpr unsigned width = K;
    static constexpr unsigned lanes = WideBvh<K>::lanes;

    FullLayout(const WideBvh<K>& tree, const TriangleTransforms* transforms)
        : tree_(tree), transforms_(transforms) {}

    StackEntry root(float t_min) const { return {t_min, 0, 0}; }
    HWY_INLINE bool is_leaf(const StackEntry& entry) const { return entry.count != 0; }

    HWY_INLINE const WideNode<K>& node(const StackEntry& entry) const {
        return tree_.nodes[entry.child];
    }

    template <bool AnyHit, class Ray>
    HWY_INLINE static unsigned enter(const WideNode<K>& node, const Ray& ray, float t_far,
                                     float* urgency) {
        const auto planes = [&](auto d, int, int row, unsigned i)
                                HWY_ATTR { return hn::Load(d, node.planes[row] + i); };
        return enter_boxes<K, AnyHit>(planes, ray, t_far, urgency);
    }
    HWY_INLINE static StackEntry child(const WideNode<K>& node, unsigned i, float urgency) {
        return {urgency, node.child[i], node.count[i]};
    }
    static unsigned box_count(const WideNode<K>& node) {
        unsigned boxes = 0;
        for (unsigned i = 0; i < K; ++i) boxes += !node.is_missing(i);
        return boxes;
    }

    unsigned triangle_count(const StackEntry& leaf) const { return leaf.count; }

    /// Calls visit(lanes, used) for the leaf's blocks until it returns true.
    template <class Visit>
    HWY_INLINE void for_each_block(const StackEntry& leaf, const Visit& visit) const {
        for (std::uint32_t first = 0; first < leaf.count; first += lanes) {
            const std::uint32_t used = std::min(leaf.count - first, std::uint32_t(lanes));
            const std::uint32_t index = leaf.child + first / lanes;
            const BlockLanes<lanes> block{tree_.blocks[index], index, transforms_};
            if (visit(block, (1U << used) - 1U)) return;
        }
    }

private:
    const WideBvh<K>& tree_;
    const TriangleTransforms* transforms_;
};

template <unsigned K>
FullLayout<K> layout_of(const WideBvh<K>& tree, const TriangleTransforms* transforms) {
    return {tree, transforms};
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#endif  // per target
