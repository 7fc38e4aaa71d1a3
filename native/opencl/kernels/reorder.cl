// SPDX-License-Identifier: GPL-3.0-or-later
// Sort keys of rays (Meister et al. 2020): RayKeys of trace/reorder.cpp, operation by operation in
// double, so that keys are the host's bit for bit.

#define BITS_PER_AXIS 13

/// What RayKeys holds.
typedef struct {
    double lower[3];  // of the scene's box
    double scale;     // 1 / side of its cube; 0 where the box is a point
} KeySpace;

/// Reorder of trace/reorder.h.
enum { order_off, order_aila, order_origin, order_octahedron, order_two_point };

// --- codes --------------------------------------------------------------------------------------

/// Spreads the lowest 21 bits so that two zero bits follow each.
inline ulong spread_by_three(ulong value) {
    value &= 0x1FFFFFUL;
    value = (value | value << 32) & 0x001F00000000FFFFUL;
    value = (value | value << 16) & 0x001F0000FF0000FFUL;
    value = (value | value << 8) & 0x100F00F00F00F00FUL;
    value = (value | value << 4) & 0x10C30C30C30C30C3UL;
    value = (value | value << 2) & 0x1249249249249249UL;
    return value;
}

/// Cell of a coordinate in [0, 1]; what lies outside is clamped.
inline ulong cell(double coordinate) {
    const double last = (double)((1 << BITS_PER_AXIS) - 1);
    const double inside = coordinate < 0.0 ? 0.0 : coordinate;
    return (ulong)(long)((1.0 < inside ? 1.0 : inside) * last);
}

/// Interleaves three cells, x highest.
inline ulong interleave(double x, double y, double z) {
    return spread_by_three(cell(x)) << 2 | spread_by_three(cell(y)) << 1 | spread_by_three(cell(z));
}

/// Level `index` of an interleaved code, 0 the highest: three bits.
inline uint level(ulong code, int index) {
    return (uint)(code >> (3 * (BITS_PER_AXIS - 1 - index))) & 7U;
}

/// The highest `count` levels.
inline uint levels(ulong code, int count) {
    return (uint)(code >> (3 * (BITS_PER_AXIS - count)));
}

// --- keys ---------------------------------------------------------------------------------------

/// `towards`: the code of the unit direction.
inline uint aila_key(ulong origin, ulong towards) {
    uint key = levels(origin, 3);
    for (int i = 0; i < 3; ++i) key = key << 6 | level(origin, 3 + i) << 3 | level(towards, i);
    return key << 5 | level(origin, 6) << 2 | level(towards, 3) >> 1;
}

inline uint origin_key(ulong origin) {
    return levels(origin, 10) << 2 | level(origin, 10) >> 1;
}

/// The direction's place on an octahedron unfolded to [0, 1]^2.
inline uint octahedron_key(ulong origin, double x, double y, double z) {
    const double width = fabs(x), height = fabs(y);
    const double scale = 1.0 / (width + height + fabs(z));
    const bool below = z < 0.0;
    const double px = below ? 1.0 - height * scale : width * scale;
    const double py = below ? 1.0 - width * scale : height * scale;
    const ulong towards =
        interleave(0.5 * (copysign(px, x) + 1.0), 0.5 * (copysign(py, y) + 1.0), 0.0);
    uint key = levels(origin, 4);
    for (int i = 0; i < 4; ++i) key = key << 5 | level(origin, 4 + i) << 2 | level(towards, i) >> 1;
    return key;
}

/// `end`: the code of where the ray may end.
inline uint two_point_key(ulong origin, ulong end) {
    uint key = 0;
    for (int i = 0; i < 5; ++i) key = key << 6 | level(origin, i) << 3 | level(end, i);
    return key << 2 | level(origin, 5) >> 1;
}

kernel void compute_ray_keys(__global const Ray* rays, uint count,
                             uint order,  // a Reorder other than off
                             KeySpace space,
                             double ray_length,  // most of the cube's side that a ray goes on
                             __global uint* keys, __global uint* indices) {
    const uint index = (uint)get_global_id(0);
    if (index >= count) return;
    indices[index] = index;
    const Ray ray = rays[index];
    const double sx = ((double)ray.origin[0] - space.lower[0]) * space.scale;
    const double sy = ((double)ray.origin[1] - space.lower[1]) * space.scale;
    const double sz = ((double)ray.origin[2] - space.lower[2]) * space.scale;
    const ulong origin = interleave(sx, sy, sz);
    double x = (double)ray.direction[0], y = (double)ray.direction[1], z = (double)ray.direction[2];
    if (order == order_origin) {
        keys[index] = origin_key(origin);
        return;
    }
    if (order == order_octahedron) {
        keys[index] = octahedron_key(origin, x, y, z);
        return;
    }
    const double length_ = sqrt(x * x + y * y + z * z);
    const double inverse = 1.0 / length_;
    x *= inverse;
    y *= inverse;
    z *= inverse;
    if (order == order_aila) {
        keys[index] =
            aila_key(origin, interleave(0.5 * (x + 1.0), 0.5 * (y + 1.0), 0.5 * (z + 1.0)));
        return;
    }
    const double ends = space.scale > 0.0 ? (double)ray.t_max * length_ * space.scale : 0.0;
    const double reach = ends < 0.0 ? 0.0 : ray_length < ends ? ray_length : ends;
    keys[index] = two_point_key(origin, interleave(sx + reach * x, sy + reach * y, sz + reach * z));
}
