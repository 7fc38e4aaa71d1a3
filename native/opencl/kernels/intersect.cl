// SPDX-License-Identifier: GPL-3.0-or-later
// The triangle step of traversal: the watertight test of trace/intersect.h, where all is explained.
//
// What double can decide is decided here. Where it cannot, a program built with CAREFUL goes on
// without rounding (exact.cl); any other answers `undecided`, and the ray is traced again by the
// careful one. Few rays are: this keeps the arithmetic without rounding, which needs much memory,
// out of the kernel that nearly all rays go through.
//
// A leaf's triangles are rows of corners: coordinate `axis` of corner c of triangle `lane` is
// rows[(3 c + axis) * stride + lane].

// LANES triangles go through the float filter at once; with 1 each thread takes its own.

#if LANES == 1
#define LANES_FLOAT float
#define LOAD_LANES(numbers) (*(numbers))
#else
#define LANES_FLOAT JOIN(float, LANES)
#define LOAD_LANES(numbers) JOIN(vload, LANES)(0, numbers)
#endif
#define LANES_MASK JOIN(mask_bits, LANES)

typedef enum { missed, met, undecided } Meeting;

// --- filter -------------------------------------------------------------------------------------

inline LANES_FLOAT row_of(__global const float* rows, uint stride, int corner, int axis) {
    return LOAD_LANES(rows + (uint)(3 * corner + axis) * stride);
}

/// A corner of each triangle, sheared so that the ray runs along the z axis.
inline void project(const PreparedRay* ray, __global const float* rows, uint stride, int corner,
                    LANES_FLOAT* x, LANES_FLOAT* y) {
    const LANES_FLOAT z = row_of(rows, stride, corner, ray->kz) - ray->origin_z;
    *x = (row_of(rows, stride, corner, ray->kx) - ray->origin_x) - ray->shear_x * z;
    *y = (row_of(rows, stride, corner, ray->ky) - ray->origin_y) - ray->shear_y * z;
}

/// Bit i set where triangle i may be met: its edge functions in float do not differ in sign by more
/// than their error (may_meet of trace/triangles-inl.h). NaN is kept, as comparisons are then
/// false.
inline uint may_meet(const PreparedRay* ray, __global const float* rows, uint stride) {
    LANES_FLOAT ax, ay, bx, by, cx, cy;
    project(ray, rows, stride, 0, &ax, &ay);
    project(ray, rows, stride, 1, &bx, &by);
    project(ray, rows, stride, 2, &cx, &cy);
    const LANES_FLOAT a = cx * by - cy * bx;
    const LANES_FLOAT b = ax * cy - ay * cx;
    const LANES_FLOAT c = bx * ay - by * ax;

#define GREATER(p, q) ((p) > (q) ? (p) : (q))
#define LESSER(p, q) ((p) < (q) ? (p) : (q))
    const LANES_FLOAT px = GREATER(fabs(ax), GREATER(fabs(bx), fabs(cx)));
    const LANES_FLOAT py = GREATER(fabs(ay), GREATER(fabs(by), fabs(cy)));
    const LANES_FLOAT p = GREATER(px, py);
    const float error = ray->projection_error;
    const LANES_FLOAT bound =
        (4.0F * error + (8.0F * 0x1p-24F) * p) * p + (2.0F * error * error + FLT_MIN);
    const LANES_FLOAT least = LESSER(a, LESSER(b, c));
    const LANES_FLOAT most = GREATER(a, GREATER(b, c));
#undef GREATER
#undef LESSER
    return ~LANES_MASK((least < -bound) & (most > bound));
}

// --- own box ------------------------------------------------------------------------------------

inline float least_of(float p, float q, float r) {
    const float least = r < q ? r : q;
    return least < p ? least : p;
}
inline float most_of(float p, float q, float r) {
    const float most = q < r ? r : q;
    return p < most ? most : p;
}

/// Computed interval in which the ray is inside the triangle's own box; false where it is empty.
inline bool own_interval(const PreparedRay* ray, __global const float* triangle, uint stride,
                         float* near, float* far) {
    *near = ray->t_min;
    *far = ray->t_max;
    for (uint axis = 0; axis < 3; ++axis) {
        const float p = triangle[axis * stride];
        const float q = triangle[(3 + axis) * stride];
        const float r = triangle[(6 + axis) * stride];
        const float lower = least_of(p, q, r), upper = most_of(p, q, r);
        const Slab* slab = &ray->slab[axis];
        const float enter =
            ((slab->negative ? upper : lower) - slab->near_origin) * slab->near_inverse;
        const float leave =
            ((slab->negative ? lower : upper) - slab->far_origin) * slab->far_inverse;
        if (*near < enter) *near = enter;
        if (leave < *far) *far = leave;
    }
    return *near <= *far;
}

// --- triangle -----------------------------------------------------------------------------------

typedef struct {
    double a, b, c;   // weights of the corners up to a common factor
    double z[3];      // depths of the corners
    double bound;     // on the error of a, b and c
    double farthest;  // no corner is farther from the origin along any axis
} EdgeFunctions;

/// Of numbers that are not NaN.
inline double larger(double p, double q) {
    return p < q ? q : p;
}

/// edge_functions() of trace/intersect.h before any is decided.
inline EdgeFunctions edge_functions(const PreparedRay* ray, __global const float* triangle,
                                    uint stride) {
    EdgeFunctions edges;
    double x[3], y[3], farthest = 0.0, largest = 0.0;
    for (int corner = 0; corner < 3; ++corner) {
        __global const float* const rows = triangle + (uint)(3 * corner) * stride;
        const double along_x = (double)rows[(uint)ray->kx * stride] - (double)ray->origin_x;
        const double along_y = (double)rows[(uint)ray->ky * stride] - (double)ray->origin_y;
        const double z = (double)rows[(uint)ray->kz * stride] - (double)ray->origin_z;
        x[corner] = along_x - ray->shear_xd * z;
        y[corner] = along_y - ray->shear_yd * z;
        edges.z[corner] = z;
        farthest = larger(farthest, larger(larger(fabs(along_x), fabs(along_y)), fabs(z)));
        largest = larger(largest, larger(fabs(x[corner]), fabs(y[corner])));
    }
    edges.a = x[2] * y[1] - y[2] * x[1];
    edges.b = x[0] * y[2] - y[0] * x[2];
    edges.c = x[1] * y[0] - y[1] * x[0];
    const double error = 0x1p-50 * farthest;
    edges.bound = (4.0 * error + 0x1p-50 * largest) * largest + 2.0 * error * error;
    edges.farthest = farthest;
    return edges;
}

/// Whether the sign of one edge function or another is not certain.
inline bool is_vague(const EdgeFunctions* edges) {
    return fabs(edges->a) <= edges->bound || fabs(edges->b) <= edges->bound ||
           fabs(edges->c) <= edges->bound;
}

/// Whether the signs that are certain differ: then the others do not matter.
inline bool passes_by(const EdgeFunctions* edges) {
    const double bound = edges->bound;
    return (edges->a < -bound || edges->b < -bound || edges->c < -bound) &&
           (edges->a > bound || edges->b > bound || edges->c > bound);
}

#ifdef CAREFUL
inline void read_corners(__global const float* triangle, uint stride, float corners[3][3]) {
    for (uint corner = 0; corner < 3; ++corner)
        for (uint axis = 0; axis < 3; ++axis)
            corners[corner][axis] = triangle[(3 * corner + axis) * stride];
}

/// Evaluates those without rounding whose sign is not certain.
void decide_edges(const PreparedRay* ray, const Ray* given, __global const float* triangle,
                  uint stride, EdgeFunctions* edges) {
    float corners[3][3];
    read_corners(triangle, stride, corners);
    const float longest = along(given->direction, ray->kz);
    if (fabs(edges->a) <= edges->bound)
        edges->a = exact_edge_function(given, longest, corners[2], corners[1]);
    if (fabs(edges->b) <= edges->bound)
        edges->b = exact_edge_function(given, longest, corners[0], corners[2]);
    if (fabs(edges->c) <= edges->bound)
        edges->c = exact_edge_function(given, longest, corners[1], corners[0]);
}
#endif

/// meets_triangle() of trace/intersect.h; t is scaled. A triangle that is entered beyond `nearest`
/// is missed, for it cannot be the answer.
inline Meeting meets_triangle(const PreparedRay* ray, const Ray* given,
                              __global const float* triangle, uint stride, float nearest,
                              Hit* hit) {
    EdgeFunctions edges = edge_functions(ray, triangle, stride);
    if (passes_by(&edges)) return missed;
    float near, far;
    bool vague = is_vague(&edges);
    if (vague) {
        if (!own_interval(ray, triangle, stride, &near, &far) || near > nearest) return missed;
#ifdef CAREFUL
        decide_edges(ray, given, triangle, stride, &edges);
#else
        return undecided;
#endif
    }
    const double a = edges.a, b = edges.b, c = edges.c;
    if ((a < 0.0 || b < 0.0 || c < 0.0) && (a > 0.0 || b > 0.0 || c > 0.0)) return missed;
    const double area = a + b + c;
    if (area == 0.0) return missed;
    const double depth = (a * edges.z[0] + b * edges.z[1] + c * edges.z[2]) / area;
    double t = depth * ray->shear_zd, u = b / area, v = c / area;

    const double size = fabs(area);
    const double deviation = larger(fabs(edges.z[0] - depth),
                                    larger(fabs(edges.z[1] - depth), fabs(edges.z[2] - depth)));
    const double doubt =
        (4.0 * edges.bound * deviation + 0x1p-50 * edges.farthest * size) * fabs(ray->shear_zd);
    const double past_first = (t - ray->t_first) * size;
    const double before_last = (ray->t_last - t) * size;
    vague = 0x1p26 * edges.bound > size;
    if (!vague && (past_first < -doubt || before_last < -doubt)) return missed;
    if (!own_interval(ray, triangle, stride, &near, &far) || near > nearest) return missed;
    if (vague || 0x1p24 * doubt > fabs(t) * size || past_first <= doubt || before_last <= doubt) {
#ifdef CAREFUL
        float corners[3][3];
        read_corners(triangle, stride, corners);
        if (!exact_plane_crossing(given, ray->unscale, corners[0], corners[1], corners[2], &t, &u,
                                  &v))
            return missed;
#else
        return undecided;
#endif
    }
    const float distance = (float)t;
    hit->t = distance < near ? near : far < distance ? far : distance;
    hit->u = (float)u;
    hit->v = (float)v;
    return met;
}
