// SPDX-License-Identifier: GPL-3.0-or-later
// The box step of traversal, compiled once per SIMD target (Highway's -inl.h convention).
#if defined(BVHLAB_TRACE_BOXES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BVHLAB_TRACE_BOXES_INL_H_
#undef BVHLAB_TRACE_BOXES_INL_H_
#else
#define BVHLAB_TRACE_BOXES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "trace/intersect.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Bit i set where lane i of the mask is.
template <class D, class M>
HWY_INLINE unsigned mask_bits(D d, M mask) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, mask, bits);
    return bits[0];
}

/// Bit i of the result is set where the ray enters box i of `Boxes` no farther than `t_far`;
/// `urgency[i]` (aligned) then says which comes first, the least: the distance at which the box is
/// entered, or, for any hit, minus the distance at which it is left. The nearest boxes hold the
/// surroundings of the ray's origin, which seldom block it: on the diffuse rays of crytek_sponza,
/// farthest first visits a third of the nodes.
///
/// `planes(d, axis, row, i)` gives the planes of boxes i, i + 1, ... in lanes of `d`; rows are
/// those of WideNode::planes, 2 axis + (0 lower, 1 upper), and the ray says which of two it meets
/// first. A plane that is NaN or a distance of 0 * infinity bounds nothing: Max and Min return
/// their second argument there on every target that this is compiled for.
template <unsigned Boxes, bool AnyHit, class Planes, class Ray>
HWY_INLINE unsigned enter_boxes(const Planes& planes, const Ray& ray, float t_far,
                                float* HWY_RESTRICT urgency) {
    const hn::CappedTag<float, Boxes> d;
    const auto slabs = ray.slabs();
    const auto distance = [&](int axis, int row, float origin, float inverse, unsigned i) {
        return hn::Mul(hn::Sub(planes(d, axis, row, i), hn::Set(d, origin)), hn::Set(d, inverse));
    };
    unsigned entered = 0;
    for (unsigned i = 0; i < Boxes; i += unsigned(hn::Lanes(d))) {
        const auto near_x =
            distance(0, ray.near_plane[0], slabs.near_origin.x, slabs.near_inverse.x, i);
        const auto near_y =
            distance(1, ray.near_plane[1], slabs.near_origin.y, slabs.near_inverse.y, i);
        const auto near_z =
            distance(2, ray.near_plane[2], slabs.near_origin.z, slabs.near_inverse.z, i);
        const auto far_x =
            distance(0, ray.far_plane[0], slabs.far_origin.x, slabs.far_inverse.x, i);
        const auto far_y =
            distance(1, ray.far_plane[1], slabs.far_origin.y, slabs.far_inverse.y, i);
        const auto far_z =
            distance(2, ray.far_plane[2], slabs.far_origin.z, slabs.far_inverse.z, i);
        const auto enter = hn::Max(hn::Max(near_x, near_y), hn::Max(near_z, hn::Set(d, ray.t_min)));
        const auto leave = hn::Min(hn::Min(far_x, far_y), hn::Min(far_z, hn::Set(d, t_far)));
        hn::Store(AnyHit ? hn::Neg(leave) : enter, d, urgency + i);
        entered |= mask_bits(d, hn::Le(enter, leave)) << i;
    }
    return entered;
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#endif  // per target
