// SPDX-License-Identifier: GPL-3.0-or-later
// Where a ray met a surface, and where the next one starts: render/offset.h, which derives the
// bounds, render/interpolate.h and render/terminator.h.

#define UNIT_ROUNDOFF 0x1p-24
#define END_CLEARANCE (2.0 * UNIT_ROUNDOFF)
#define TERMINATOR_COSINE 0.1

typedef struct {
    double3 position;  ///< on the original triangle
    double3 normal;    ///< geometric, unit length, on the side that the ray came from
    double clearance;  ///< distance along the normal that new origins keep
    bool inside;       ///< the ray came from where the winding is clockwise
} SurfacePoint;

static double3 at_weights(Corners corners, double3 weights) {
    return weights.x * corners.a + weights.y * corners.b + weights.z * corners.c;
}

static double3 inset(double3 weights, double least) {
    const double3 less = weights - least;
    const double3 spare = (double3)(most_d(less.x, 0.0), most_d(less.y, 0.0), most_d(less.z, 0.0));
    const double sum = spare.x + spare.y + spare.z;
    return sum > 0.0 ? least + spare * ((1.0 - 3.0 * least) / sum) : all_d(1.0 / 3.0);
}

CALLED SurfacePoint surface_point(Corners corners, double u, double v, double3 ray_direction) {
    const double denormal = 0x1p-148, most_aspect = 0x1p27;
    const double3 weights = (double3)(1.0 - u - v, u, v);
    SurfacePoint point;
    point.position = at_weights(corners, weights);

    const double3 ab = corners.b - corners.a, ac = corners.c - corners.a,
                  bc = corners.c - corners.b;
    const double3 cross = cross_d(ab, ac);
    const double length = length_d(cross);
    point.normal = length > 0.0 ? cross / length : -unit_d(ray_direction);
    point.inside = dot_d(point.normal, ray_direction) > 0.0;
    if (point.inside) point.normal = -point.normal;

    const double squared = most_d(most_d(dot_d(ab, ab), dot_d(ac, ac)), dot_d(bc, bc));
    const double longest = sqrt(squared);
    const double aspect = squared < most_aspect * length ? squared / length : most_aspect;
    const double rounding = dot_d(fabs(point.normal), fabs(point.position));
    point.clearance =
        UNIT_ROUNDOFF * (2.0 * rounding + 4.0 * longest) + 0x1p-46 * longest * aspect + denormal;

    const double margin = point.clearance + 2.0 * UNIT_ROUNDOFF * length_d(point.position);
    const double least = 3.0 * margin * longest < length ? margin * longest / length : 1.0 / 3.0;
    if (least_d(least_d(weights.x, weights.y), weights.z) < least)
        point.position = at_weights(corners, inset(weights, least));
    return point;
}

static SurfacePoint hit_point(const Scene* scene, PathHit hit, double3 direction) {
    return surface_point(corners_of(scene, hit.triangle), (double)hit.u, (double)hit.v, direction);
}

/// Origin of a ray that leaves the surface towards `direction`.
static float3 offset_origin(double3 position, double3 normal, double clearance, double3 direction) {
    const double side = dot_d(normal, direction) >= 0.0 ? 1.0 : -1.0;
    return convert_float3(position + side * clearance * normal);
}

static float3 leaving(const SurfacePoint* point, double3 direction) {
    return offset_origin(point->position, point->normal, point->clearance, direction);
}

// --- smooth triangles ---------------------------------------------------------------------------

#ifdef SMOOTH
/// Unit normal between the corner normals, on the side of the geometric one.
static float3 shading_normal(const Scene* scene, PathHit hit, const SurfacePoint* surface) {
    const size_t corner = 3 * (size_t)hit.triangle;
    const float3 sum = (1.0F - hit.u - hit.v) * load_f(scene->normals, corner) +
                       hit.u * load_f(scene->normals, corner + 1) +
                       hit.v * load_f(scene->normals, corner + 2);
    const float squared = dot_f(sum, sum);
    if (!(squared > 1e-12F)) return convert_float3(surface->normal);
    return sum * divide(surface->inside ? -1.0F : 1.0F, square_root(squared));
}

/// How far a shadow ray's origin is lifted off a smooth triangle (Hanika 2021, "Hacking the Shadow
/// Terminator").
static double3 terminator_lift(const Scene* scene, PathHit hit, double3 position, bool inside,
                               double facing, double3 side) {
    const double amount = clamp_d(1.0 - facing / TERMINATOR_COSINE, 0.0, 1.0);
    if (amount == 0.0) return all_d(0.0);
    const Corners corners = corners_of(scene, hit.triangle);
    const double u = (double)hit.u, v = (double)hit.v;
    double3 lift = all_d(0.0);
    for (int i = 0; i < 3; ++i) {
        const float3 given = load_f(scene->normals, 3 * (size_t)hit.triangle + i);
        const double3 normal = convert_double3(inside ? -given : given);
        const double3 place = i == 0 ? corners.a : i == 1 ? corners.b : corners.c;
        const double weight = i == 0 ? 1.0 - u - v : i == 1 ? u : v;
        lift -= weight * least_d(0.0, dot_d(position - place, normal)) * normal;
    }
    return dot_d(lift, side) > 0.0 ? amount * lift : all_d(0.0);
}
#endif
