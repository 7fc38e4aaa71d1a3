// SPDX-License-Identifier: GPL-3.0-or-later
// The box step of traversal over vectors of WIDTH boxes, as trace/boxes-inl.h.

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

/// One lane for each child of a node.
#define FLOATS JOIN(float, WIDTH)
#define INTS JOIN(int, WIDTH)

// --- masks --------------------------------------------------------------------------------------

/// Bit i is set where lane i of the mask is -1. Clang for x86 (PoCL) has one instruction for it;
/// all other devices gather the lanes' bits.
#if defined(__clang__) && defined(__AVX__) && defined(__x86_64__)
inline uint mask_bits8(int8 mask) {
    return (uint)__builtin_ia32_movmskps256(as_float8(mask));
}
inline uint mask_bits4(int4 mask) {
    return (uint)__builtin_ia32_movmskps(as_float4(mask));
}
#else
inline uint mask_bits8(int8 mask) {
    const int8 bits = mask & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 half_ = bits.lo | bits.hi;
    return (uint)(half_.x | half_.y | half_.z | half_.w);
}
inline uint mask_bits4(int4 mask) {
    const int4 bits = mask & (int4)(1, 2, 4, 8);
    return (uint)(bits.x | bits.y | bits.z | bits.w);
}
#endif
inline uint mask_bits2(int2 mask) {
    return (uint)((mask.x & 1) | (mask.y & 2));
}

inline uint mask_bits1(int mask) {
    return (uint)(mask & 1);
}

/// Place of the lowest bit that is set; `bits` is not 0.
inline uint lowest_bit(uint bits) {
    return popcount((bits & -bits) - 1);
}

// --- boxes --------------------------------------------------------------------------------------

/// The greater and lesser of numbers of which none is NaN: planes are finite or empty boxes', and
/// inverses finite and not 0 (trace/intersect.h).
inline FLOATS greater(FLOATS a, FLOATS b) {
    return a > b ? a : b;
}
inline FLOATS lesser(FLOATS a, FLOATS b) {
    return a < b ? a : b;
}

/// Bit i of the result is set where the ray enters box i no farther than `t_far`; `urgency` then
/// says which comes first, the least: the distance at which the box is entered, or, for any hit,
/// minus the distance at which it is left.
inline uint enter_boxes(const PreparedRay* ray, float t_far, bool any_hit,
                        FLOATS near_x,  // planes that the ray meets first and last, by axis
                        FLOATS far_x, FLOATS near_y, FLOATS far_y, FLOATS near_z, FLOATS far_z,
                        FLOATS* urgency) {
    const Slab *x = &ray->slab[0], *y = &ray->slab[1], *z = &ray->slab[2];
    const FLOATS enter = greater(greater((near_x - x->near_origin) * x->near_inverse,
                                         (near_y - y->near_origin) * y->near_inverse),
                                 greater((near_z - z->near_origin) * z->near_inverse, ray->t_min));
    const FLOATS leave = lesser(
        lesser((far_x - x->far_origin) * x->far_inverse, (far_y - y->far_origin) * y->far_inverse),
        lesser((far_z - z->far_origin) * z->far_inverse, t_far));
    *urgency = any_hit ? -leave : enter;
    return JOIN(mask_bits, WIDTH)(enter <= leave);
}
