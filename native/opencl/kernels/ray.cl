// SPDX-License-Identifier: GPL-3.0-or-later
// Rays as box and triangle tests need them: BoxRay and PreparedRay of trace/intersect.h, operation
// by operation. Why each number is what it is stands there.

// --- types of the host, member for member -------------------------------------------------------

/// trace/ray.h
typedef struct {
    float origin[3];
    float t_min;
    float direction[3];
    float t_max;
} Ray;

/// trace/ray.h
typedef struct {
    float t, u, v;
    uint triangle;
} Hit;

// --- prepared rays ------------------------------------------------------------------------------

/// Planes of a box that are normal to one axis, as the ray meets them.
typedef struct {
    float near_origin, near_inverse;  // distance = (plane - origin) * inverse
    float far_origin, far_inverse;
    uint negative;  // 1 where the ray meets the upper plane first
} Slab;

typedef struct {
    Slab slab[3];
    float t_min, t_max;                  // scaled, rounded outward
    double unscale;                      // the caller's t = scaled t * unscale
    int kx, ky, kz;                      // kz: axis of the longest direction component
    float origin_x, origin_y, origin_z;  // along kx, ky, kz
    float shear_x, shear_y;              // of the float filter
    float projection_error;
    double shear_xd, shear_yd, shear_zd;
    double t_first, t_last;  // t_min and t_max scaled, exact
} PreparedRay;

/// v[axis] without an array in memory.
inline float along(const float v[3], int axis) {
    return axis == 0 ? v[0] : axis == 1 ? v[1] : v[2];
}

/// 2^exponent for -1022 <= exponent <= 1023.
inline double power_of_two(int exponent) {
    return as_double((ulong)(exponent + 1023) << 52);
}

/// Floor of log2 of a positive normal number.
inline int exponent_of(double value) {
    return (int)(as_ulong(value) >> 52) - 1023;
}

/// The float nearest to a number >= 0 that is not above it.
inline float rounded_down(double value) {
    const float near = (float)value;
    return (double)near > value ? as_float(as_uint(near) - 1) : near;
}

/// The float nearest to a number >= 0 that is not below it.
inline float rounded_up(double value) {
    const float near = (float)value;
    return (double)near < value ? as_float(as_uint(near) + 1) : near;
}

/// No box corner is farther from the origin than this, along any axis.
inline float reach_of(const Ray* ray, const Box* bounds) {
    float reach = 0.0F;
    for (int axis = 0; axis < 3; ++axis) {
        reach = fmax(reach, fabs(bounds->lower[axis] - ray->origin[axis]));
        reach = fmax(reach, fabs(bounds->upper[axis] - ray->origin[axis]));
    }
    return reach;
}

/// `direction`: scaled.
inline Slab slab_of(float origin, float direction, float reach) {
    const float u = 0x1p-24F;
    Slab slab;
    slab.negative = as_uint(direction) >> 31;
    slab.near_origin = slab.far_origin = origin;
    if (fabs(direction) < 0x1p-100F) {
        const float nudge = fmax(4.0F * u * fmax(reach, fabs(origin)), 0x1p-120F);
        const uint sign = slab.negative << 31;
        slab.near_origin += as_float(as_uint(nudge) | sign);
        slab.far_origin -= as_float(as_uint(nudge) | sign);
        slab.near_inverse = slab.far_inverse = as_float(as_uint(0x1p126F) | sign);
    } else {
        const float inverse = divide(1.0F, direction);
        slab.near_inverse = inverse * (1.0F - 8.0F * u);
        slab.far_inverse = inverse * (1.0F + 8.0F * u);
    }
    return slab;
}

/// `bounds` is the mesh's box: the same for all trees.
inline PreparedRay prepared(const Ray* ray, const Box* bounds) {
    PreparedRay p;
    const float reach = reach_of(ray, bounds);

    // Scale by a power of two.
    const float longest =
        fmax(fabs(ray->direction[0]), fmax(fabs(ray->direction[1]), fabs(ray->direction[2])));
    const int exponent = exponent_of((double)longest) + (reach < 0x1p-100F ? 60 : 0);
    const double scale = power_of_two(exponent);
    p.unscale = power_of_two(-exponent);
    float direction[3];
    for (int axis = 0; axis < 3; ++axis) {
        direction[axis] = (float)((double)ray->direction[axis] * p.unscale);
        p.slab[axis] = slab_of(ray->origin[axis], direction[axis], reach);
    }
    p.t_min = rounded_down((double)ray->t_min * scale);
    p.t_max = rounded_up((double)ray->t_max * scale);
    p.t_first = (double)ray->t_min / p.unscale;
    p.t_last = (double)ray->t_max / p.unscale;

    // Shear along the longest axis.
    const float x = fabs(direction[0]), y = fabs(direction[1]), z = fabs(direction[2]);
    p.kz = x >= y ? (x >= z ? 0 : 2) : (y >= z ? 1 : 2);
    p.kx = p.kz == 2 ? 0 : p.kz + 1;
    p.ky = p.kx == 2 ? 0 : p.kx + 1;
    const double longest_given = (double)along(ray->direction, p.kz);
    p.shear_zd = 1.0 / (double)along(direction, p.kz);
    p.shear_xd = (double)along(ray->direction, p.kx) / longest_given;
    p.shear_yd = (double)along(ray->direction, p.ky) / longest_given;
    p.shear_x = (float)p.shear_xd;
    p.shear_y = (float)p.shear_yd;
    p.projection_error = 8.0F * 0x1p-24F * reach;
    p.origin_x = along(ray->origin, p.kx);
    p.origin_y = along(ray->origin, p.ky);
    p.origin_z = along(ray->origin, p.kz);
    return p;
}
