// SPDX-License-Identifier: GPL-3.0-or-later
// The triangle step of traversal, compiled once per SIMD target (Highway's -inl.h convention).
//
// A triangle test is a class with
//     template <bool AnyHit, class Lanes, class Ray>
//     static void intersect(const Lanes& lanes, unsigned used, const Ray& ray, Hit& hit);
// which lets every triangle whose bit in `used` is set compete for `hit`. `Lanes` is how a tree's
// layout hands over up to Lanes::count triangles:
//     lanes.corners(d, corner, axis, i)  coordinates of triangles i, i + 1, ... in lanes of `d`
//     lanes.corners(lane, float[3][3])   [corner][axis] of one triangle
//     lanes.triangle(lane)               its index in the mesh
#if defined(BVHLAB_TRACE_TRIANGLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BVHLAB_TRACE_TRIANGLES_INL_H_
#undef BVHLAB_TRACE_TRIANGLES_INL_H_
#else
#define BVHLAB_TRACE_TRIANGLES_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstdint>
#include <limits>

#include "trace/boxes-inl.h"
#include "trace/intersect.h"
#include "trace/ray.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Bit i set where triangle i may be met: its edge functions in float do not differ in sign by more
/// than their error. With e = projection_error the bound on a projected coordinate's error (its
/// terms are below 6u * reach) and p the largest projected coordinate, an edge function errs by
/// less than 4 e p + 2 e^2 + 4 u p^2; the smallest normal float covers underflow. Overflow yields
/// infinities or NaN, for which the comparisons are false and the triangle is kept.
template <class Lanes>
HWY_INLINE unsigned may_meet(const Lanes& lanes, const PreparedRay& ray) {
    const hn::CappedTag<float, Lanes::count> d;
    using V = hn::Vec<decltype(d)>;
    const V origin_x = hn::Set(d, ray.origin[ray.kx]);
    const V origin_y = hn::Set(d, ray.origin[ray.ky]);
    const V origin_z = hn::Set(d, ray.origin[ray.kz]);
    const V shear_x = hn::Set(d, ray.shear_x), shear_y = hn::Set(d, ray.shear_y);
    const float error = ray.projection_error;
    unsigned kept = 0;
    for (unsigned i = 0; i < Lanes::count; i += unsigned(hn::Lanes(d))) {
        const auto project = [&](int corner, V& x, V& y) {
            const V z = hn::Sub(lanes.corners(d, corner, ray.kz, i), origin_z);
            x = hn::Sub(hn::Sub(lanes.corners(d, corner, ray.kx, i), origin_x),
                        hn::Mul(shear_x, z));
            y = hn::Sub(hn::Sub(lanes.corners(d, corner, ray.ky, i), origin_y),
                        hn::Mul(shear_y, z));
        };
        V ax, ay, bx, by, cx, cy;
        project(0, ax, ay);
        project(1, bx, by);
        project(2, cx, cy);
        const V a = hn::Sub(hn::Mul(cx, by), hn::Mul(cy, bx));
        const V b = hn::Sub(hn::Mul(ax, cy), hn::Mul(ay, cx));
        const V c = hn::Sub(hn::Mul(bx, ay), hn::Mul(by, ax));

        const V px = hn::Max(hn::Abs(ax), hn::Max(hn::Abs(bx), hn::Abs(cx)));
        const V py = hn::Max(hn::Abs(ay), hn::Max(hn::Abs(by), hn::Abs(cy)));
        const V p = hn::Max(px, py);
        const V bound = hn::Add(
            hn::Mul(hn::Add(hn::Set(d, 4.0F * error), hn::Mul(hn::Set(d, 8.0F * 0x1p-24F), p)), p),
            hn::Set(d, 2.0F * error * error + std::numeric_limits<float>::min()));
        const V least = hn::Min(a, hn::Min(b, c));
        const V most = hn::Max(a, hn::Max(b, c));
        const auto apart = hn::And(hn::Lt(least, hn::Neg(bound)), hn::Gt(most, bound));
        kept |= (~mask_bits(d, apart) & ((1U << hn::Lanes(d)) - 1U)) << i;
    }
    return kept;
}

/// The exact test of intersect.h.
struct Watertight {
    template <bool AnyHit, class Lanes>
    HWY_INLINE static void intersect(const Lanes& lanes, unsigned used, const PreparedRay& ray,
                                     Hit& hit) {
        for (unsigned kept = may_meet(lanes, ray) & used; kept != 0; kept &= kept - 1) {
            intersect_lane(lanes, unsigned(std::countr_zero(kept)), ray, hit);
            if (AnyHit && hit.triangle != no_triangle) return;
        }
    }

private:
    template <class Lanes>
    static void intersect_lane(const Lanes& lanes, unsigned lane, const PreparedRay& ray,
                               Hit& hit) {
        float corners[3][3];
        lanes.corners(lane, corners);
        float t, u, v;
        if (!meets_triangle(ray, corners, t, u, v, hit.t)) return;
        const std::uint32_t triangle = lanes.triangle(lane);
        if (t < hit.t || (t == hit.t && triangle < hit.triangle)) hit = {t, u, v, triangle};
    }
};

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#endif  // per target
