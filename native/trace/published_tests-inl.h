// SPDX-License-Identifier: GPL-3.0-or-later
// Triangle tests in float as they were published, to compare the default with. Compiled once per
// SIMD target (Highway's -inl.h convention); triangles-inl.h says what a triangle test is. Those
// with a transform (transforms.h) ask `Lanes` for
//     lanes.values(d, k, i)  value k of the transforms of triangles i, i + 1, ... in lanes of `d`
//
// All are two-sided, take closed triangles and a closed interval of t, have no absolute epsilon,
// and give equal t to the lower index. NaN meets nothing: no comparison holds for it.
#if defined(BVHLAB_TRACE_PUBLISHED_TESTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BVHLAB_TRACE_PUBLISHED_TESTS_INL_H_
#undef BVHLAB_TRACE_PUBLISHED_TESTS_INL_H_
#else
#define BVHLAB_TRACE_PUBLISHED_TESTS_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstdint>

#include "trace/boxes-inl.h"
#include "trace/ray.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class V>
struct Vector3 {
    V x, y, z;
};

template <class V>
HWY_INLINE V dot(const Vector3<V>& a, const Vector3<V>& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}

template <class V>
HWY_INLINE Vector3<V> cross(const Vector3<V>& a, const Vector3<V>& b) {
    return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
            hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
            hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}

template <class V>
HWY_INLINE Vector3<V> sub(const Vector3<V>& a, const Vector3<V>& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

/// One coordinate triple in all lanes.
template <class D>
HWY_INLINE Vector3<hn::Vec<D>> broadcast(D d, const glm::vec3& v) {
    return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)};
}

/// The base of the published tests, each of which has
///     template <class D, class Lanes, class Ray>
///     static unsigned meets(D d, const Lanes&, unsigned i, const Ray&, float t_far,
///                           V& t, V& u, V& v);
/// Bit j of it is set where the ray meets triangle i + j no farther than `t_far`.
template <class Test>
struct PublishedTest {
    template <bool AnyHit, class Lanes, class Ray>
    HWY_INLINE static void intersect(const Lanes& lanes, unsigned used, const Ray& ray, Hit& hit) {
        const hn::CappedTag<float, Lanes::count> d;
        using V = hn::Vec<decltype(d)>;
        for (unsigned i = 0; i < Lanes::count; i += unsigned(hn::Lanes(d))) {
            V t, u, v;
            const unsigned met = Test::meets(d, lanes, i, ray, hit.t, t, u, v) & (used >> i);
            if (met == 0) continue;
            HWY_ALIGN float ts[Lanes::count], us[Lanes::count], vs[Lanes::count];
            hn::Store(t, d, ts);
            hn::Store(u, d, us);
            hn::Store(v, d, vs);
            for (unsigned rest = met; rest != 0; rest &= rest - 1) {
                const unsigned lane = unsigned(std::countr_zero(rest));
                const std::uint32_t triangle = lanes.triangle(i + lane);
                if (ts[lane] < hit.t || (ts[lane] == hit.t && triangle < hit.triangle))
                    hit = {ts[lane], us[lane], vs[lane], triangle};
                if (AnyHit) return;
            }
        }
    }

protected:
    /// Bit i set where u, v >= 0, u + v <= 1 and `others`.
    template <class D, class V, class M>
    HWY_INLINE static unsigned inside(D d, V u, V v, M others) {
        const V zero = hn::Zero(d);
        const auto corner = hn::And(hn::Ge(u, zero), hn::Ge(v, zero));
        const auto far_edge = hn::Le(hn::Add(u, v), hn::Set(d, 1.0F));
        return mask_bits(d, hn::And(hn::And(corner, far_edge), others));
    }

    template <class D, class V, class Ray>
    HWY_INLINE static auto in_interval(D d, V t, const Ray& ray, float t_far) {
        return hn::And(hn::Ge(t, hn::Set(d, ray.t_min)), hn::Le(t, hn::Set(d, t_far)));
    }
};

/// Moeller, Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection", the branch without
/// culling. A determinant of 0 makes u infinite or NaN, so it meets nothing.
struct MollerTrumbore : PublishedTest<MollerTrumbore> {
    template <class D, class Lanes, class Ray, class V>
    HWY_INLINE static unsigned meets(D d, const Lanes& lanes, unsigned i, const Ray& ray,
                                     float t_far, V& t, V& u, V& v) {
        const auto corner = [&](int which) HWY_ATTR {
            return Vector3<V>{lanes.corners(d, which, 0, i), lanes.corners(d, which, 1, i),
                              lanes.corners(d, which, 2, i)};
        };
        const Vector3<V> direction = broadcast(d, ray.direction), a = corner(0);
        const Vector3<V> e1 = sub(corner(1), a), e2 = sub(corner(2), a);
        const Vector3<V> p = cross(direction, e2);
        const V inverse = hn::Div(hn::Set(d, 1.0F), dot(e1, p));
        const Vector3<V> s = sub(broadcast(d, ray.origin), a);
        const Vector3<V> q = cross(s, e1);
        u = hn::Mul(dot(s, p), inverse);
        v = hn::Mul(dot(direction, q), inverse);
        t = hn::Mul(dot(e2, q), inverse);
        return inside(d, u, v, in_interval(d, t, ray, t_far));
    }
};

/// Woop 2004 with the arithmetic of Aila, Laine 2009: the ray goes to the space in which the
/// triangle is (0, 0), (1, 0), (0, 1) in the plane z = 0; there t is where it meets the plane.
struct WoopAffine : PublishedTest<WoopAffine> {
    template <class D, class Lanes, class Ray, class V>
    HWY_INLINE static unsigned meets(D d, const Lanes& lanes, unsigned i, const Ray& ray,
                                     float t_far, V& t, V& u, V& v) {
        const Vector3<V> origin = broadcast(d, ray.origin), direction = broadcast(d, ray.direction);
        const auto row = [&](unsigned first) HWY_ATTR {
            return Vector3<V>{lanes.values(d, first, i), lanes.values(d, first + 1, i),
                              lanes.values(d, first + 2, i)};
        };
        const Vector3<V> height = row(0);
        const V above = hn::Add(dot(height, origin), lanes.values(d, 3, i));
        t = hn::Div(hn::Neg(above), dot(height, direction));
        const auto along = in_interval(d, t, ray, t_far);
        if (hn::AllFalse(d, along)) return 0;

        const auto coordinate = [&](unsigned first) HWY_ATTR {
            const Vector3<V> gradient = row(first);
            const V start = hn::Add(dot(gradient, origin), lanes.values(d, first + 3, i));
            return hn::Add(start, hn::Mul(t, dot(gradient, direction)));
        };
        u = coordinate(4);
        v = coordinate(8);
        return inside(d, u, v, along);
    }
};

/// Baldwin, Weber 2016, "Fast Ray-Triangle Intersections by Coordinate Transformation", in its form
/// with 9 coefficients and the number of the fixed column: t is where the ray meets the triangle's
/// plane, and only two coordinates of that point are needed for u and v.
struct BaldwinWeber : PublishedTest<BaldwinWeber> {
    template <class D, class Lanes, class Ray, class V>
    HWY_INLINE static unsigned meets(D d, const Lanes& lanes, unsigned i, const Ray& ray,
                                     float t_far, V& t, V& u, V& v) {
        const hn::RebindToSigned<D> integer;
        // Unused lanes may hold any number.
        const auto axis = hn::And(hn::BitCast(integer, lanes.values(d, 9, i)), hn::Set(integer, 3));
        const auto from_axis = [&](const float(&cyclic)[3][4]) HWY_ATTR {
            return Vector3<V>{looked_up(d, cyclic[0], axis), looked_up(d, cyclic[1], axis),
                              looked_up(d, cyclic[2], axis)};
        };
        const auto value = [&](unsigned k) HWY_ATTR { return lanes.values(d, k, i); };
        const Vector3<V> origin = from_axis(ray.cyclic_origin);
        const Vector3<V> direction = from_axis(ray.cyclic_direction);
        const auto height = [&](const Vector3<V>& p) HWY_ATTR {
            return hn::Add(hn::Add(p.x, hn::Mul(value(0), p.y)), hn::Mul(value(1), p.z));
        };
        t = hn::Div(hn::Neg(hn::Add(height(origin), value(2))), height(direction));
        const auto along = in_interval(d, t, ray, t_far);
        if (hn::AllFalse(d, along)) return 0;

        const V y = hn::Add(origin.y, hn::Mul(t, direction.y));
        const V z = hn::Add(origin.z, hn::Mul(t, direction.z));
        const auto coordinate = [&](unsigned first) HWY_ATTR {
            const V sum = hn::Add(hn::Mul(value(first), y), hn::Mul(value(first + 1), z));
            return hn::Add(sum, value(first + 2));
        };
        u = coordinate(3);
        v = coordinate(6);
        return inside(d, u, v, along);
    }

private:
    /// table[index] in each lane, for indices below 4.
    template <class D, class I>
    HWY_INLINE static hn::Vec<D> looked_up(D d, const float (&table)[4], I index) {
#if HWY_TARGET == HWY_SCALAR
        return hn::Set(d, table[hn::GetLane(index)]);
#else
        return hn::TableLookupLanes(hn::LoadDup128(d, table), hn::IndicesFromVec(d, index));
#endif
    }
};

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#endif  // per target
