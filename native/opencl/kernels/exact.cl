// SPDX-License-Identifier: GPL-3.0-or-later
// Arithmetic without rounding, for decisions that double cannot make: ExactSum (base/exact_sum.h)
// and what trace/expanded.cpp computes with it, in the same order, so that values are the host's
// bit for bit.
//
// A sum is an expansion (Shewchuk 1997, section 2) in a private array. Each double that is added
// makes it longer by at most one part (Grow-Expansion), which bounds all lengths:
//     a volume         3 determinants of 6 products, 2 doubles each       36
//     the determinant  3 volumes                                         108
//     the numerator    2 volumes                                          72
//     a difference     the numerator and 2 doubles for each part of the
//                      determinant                                       288

#define VOLUME_PARTS 36
#define DETERMINANT_PARTS 108
#define NUMERATOR_PARTS 72
#define DIFFERENCE_PARTS 288

// --- sums ---------------------------------------------------------------------------------------

/// Adds `value` to a sum of `count` parts; returns how many it has then.
__attribute__((noinline)) int add_value(double* parts, int count, double value) {
    if (value == 0.0) return count;
    int kept = 0;
    for (int i = 0; i < count; ++i) {
        // Knuth's TwoSum: sum + error is value + part exactly.
        const double part = parts[i];
        const double sum = value + part;
        const double part_seen = sum - value;
        const double error = (value - (sum - part_seen)) + (part - part_seen);
        if (error != 0.0) parts[kept++] = error;
        value = sum;
    }
    if (value != 0.0) parts[kept++] = value;
    return kept;
}

/// Adds factor * other.
int add_scaled(double* parts, int count, const double* other, int other_count, double factor) {
    for (int i = 0; i < other_count; ++i) {
        const double product = other[i] * factor;
        count = add_value(parts, count, fma(other[i], factor, -product));
        count = add_value(parts, count, product);
    }
    return count;
}

/// -1, 0 or 1.
inline int sign_of(const double* parts, int count) {
    return count == 0 ? 0 : parts[count - 1] > 0.0 ? 1 : -1;
}

/// The nearest double or its neighbour.
inline double value_of(const double* parts, int count) {
    double sum = 0.0;
    for (int i = 0; i < count; ++i) sum += parts[i];
    return sum;
}

// --- volumes ------------------------------------------------------------------------------------

/// Adds det(factor * x, y, z).
int add_determinant(double* parts, int count, float factor, const float* x, const float* y,
                    const float* z) {
    for (int term = 0; term < 6; ++term) {  // x[i] (y[i+1] z[i+2] - y[i+2] z[i+1])
        const int i = term >> 1, odd = term & 1;
        const int j = (i + 1 + odd) % 3, k = (i + 2 - odd) % 3;
        const double xy = (double)(odd ? -factor * x[i] : factor * x[i]) * (double)y[j];
        const double xyz = xy * (double)z[k];
        count = add_value(parts, count, fma(xy, (double)z[k], -xyz));
        count = add_value(parts, count, xyz);
    }
    return count;
}

/// det(direction, p - origin, q - origin); returns the number of its parts.
__attribute__((noinline)) int exact_volume(double* parts, const float* origin,
                                           const float* direction, const float* p, const float* q) {
    int count = add_determinant(parts, 0, 1.0F, direction, p, q);
    count = add_determinant(parts, count, -1.0F, direction, p, origin);
    return add_determinant(parts, count, -1.0F, direction, origin, q);
}

// --- decisions of trace/expanded.cpp ------------------------------------------------------------

/// The edge function of the edge between two corners; `longest` is the given direction along kz.
double exact_edge_function(const Ray* ray, float longest, const float* from, const float* to) {
    double volume[VOLUME_PARTS];
    const int count = exact_volume(volume, ray->origin, ray->direction, from, to);
    return value_of(volume, count) / (double)longest;
}

/// Sign of the crossing's t - t.
__attribute__((noinline)) int side_of(const double* numerator, int numerator_count,
                                      const double* determinant, int determinant_count, float t) {
    double difference[DIFFERENCE_PARTS];
    for (int i = 0; i < numerator_count; ++i) difference[i] = numerator[i];
    const int count =
        add_scaled(difference, numerator_count, determinant, determinant_count, -(double)t);
    return sign_of(difference, count) * sign_of(determinant, determinant_count);
}

/// Where the ray's line, which meets the triangle, crosses its plane, t scaled; false where t is
/// not in the ray's interval.
__attribute__((noinline)) bool exact_plane_crossing(const Ray* ray, double unscale, const float* a,
                                                    const float* b, const float* c, double* t,
                                                    double* u, double* v) {
    double at_b[VOLUME_PARTS], at_c[VOLUME_PARTS];
    double determinant[DETERMINANT_PARTS], numerator[NUMERATOR_PARTS];
    const int b_count = exact_volume(at_b, ray->origin, ray->direction, c, a);
    const int c_count = exact_volume(at_c, ray->origin, ray->direction, a, b);
    int d_count = exact_volume(determinant, ray->origin, ray->direction, b, c);
    d_count = add_scaled(determinant, d_count, at_b, b_count, 1.0);
    d_count = add_scaled(determinant, d_count, at_c, c_count, 1.0);

    // det(a - o, b - o, c - o)
    int n_count = exact_volume(numerator, ray->origin, a, b, c);
    double constant_[VOLUME_PARTS];
    const int o_count = exact_volume(constant_, ray->origin, ray->origin, b, c);
    n_count = add_scaled(numerator, n_count, constant_, o_count, -1.0);

    if (side_of(numerator, n_count, determinant, d_count, ray->t_min) < 0) return false;
    if (isfinite(ray->t_max) && side_of(numerator, n_count, determinant, d_count, ray->t_max) > 0)
        return false;
    const double area = value_of(determinant, d_count);
    *t = value_of(numerator, n_count) / area / unscale;
    *u = value_of(at_b, b_count) / area;
    *v = value_of(at_c, c_count) / area;
    return true;
}
