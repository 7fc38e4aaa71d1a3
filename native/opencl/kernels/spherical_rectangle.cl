// SPDX-License-Identifier: GPL-3.0-or-later
// A rectangle as seen from the origin, for drawing its points uniformly by solid angle:
// render/spherical_rectangle.h (Urena, Fajardo, King 2013, sections 3 and 4).

#ifdef AREA_LAMPS

typedef struct {
    double3 x, y, z;
    double2 low, high;
    double depth;
    double bottom_z, top_z;
    double2 first;  ///< cosine and sine of the angle at which columns start
    double solid_angle;
} SphericalRectangle;

static double hypotenuse(double a, double b) {
    return sqrt(a * a + b * b);
}

/// The angle between the planes through two neighbouring edges, as a complex number.
static double2 corner_angle(double x, double y, double sign) {
    return (double2)(sign * x * y, sqrt(1.0 + x * x + y * y));
}

static double2 complex_product(double2 a, double2 b) {
    return (double2)(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

/// Of a complex number, 0 to 2 pi.
static double argument(double2 a) {
    const double turn = atan2(a.y, a.x);
    return turn < 0.0 ? turn + 2.0 * PI : turn;
}

/// `corner` from the origin, the directions of its edges and their lengths.
static SphericalRectangle spherical_rectangle(double3 corner, double3 along_x, double3 along_y,
                                              double2 size) {
    SphericalRectangle seen;
    seen.x = along_x;
    seen.y = along_y;
    seen.z = cross_d(along_x, along_y);
    if (dot_d(corner, seen.z) > 0.0) seen.z = -seen.z;
    seen.low = (double2)(dot_d(corner, seen.x), dot_d(corner, seen.y));
    seen.high = seen.low + size;
    seen.depth = dot_d(corner, seen.z);

    const double scale = 1.0 / fabs(seen.depth);
    const double2 low = scale * seen.low, high = scale * seen.high;
    const double2 right =
        complex_product(corner_angle(high.x, low.y, 1.0), corner_angle(high.x, high.y, -1.0));
    const double2 left =
        complex_product(corner_angle(low.x, high.y, 1.0), corner_angle(low.x, low.y, -1.0));
    seen.solid_angle = argument(right) + argument(left) - 2.0 * PI;
    seen.first = (double2)(left.x, -left.y) / sqrt(left.x * left.x + left.y * left.y);
    seen.bottom_z = -low.y / hypotenuse(1.0, low.y);
    seen.top_z = high.y / hypotenuse(1.0, high.y);
    return seen;
}

/// A point of the rectangle, from the origin.
static double3 sample_rectangle(const SphericalRectangle* seen, double2 random) {
    // The column left of which the share random.x of the solid angle lies.
    const double2 turn = turn_of(random.x * seen->solid_angle);
    const double cos_angle = seen->first.x * turn.x - seen->first.y * turn.y;
    const double sin_angle = seen->first.x * turn.y + seen->first.y * turn.x;
    const double f = (cos_angle * seen->bottom_z - seen->top_z) / sin_angle;
    const double cosine = clamp_d(copysign(1.0 / hypotenuse(f, seen->bottom_z), f), -1.0, 1.0);
    const double x =
        clamp_d(-cosine * seen->depth / sqrt(1.0 - cosine * cosine), seen->low.x, seen->high.x);

    // The place in that column; its solid angle is linear in the sine of the elevation.
    const double distance = hypotenuse(x, seen->depth);
    const double lowest = seen->low.y / hypotenuse(distance, seen->low.y);
    const double highest = seen->high.y / hypotenuse(distance, seen->high.y);
    const double sine = lowest + random.y * (highest - lowest);
    const double y = clamp_d(sine * distance / sqrt(1.0 - sine * sine), seen->low.y, seen->high.y);
    return x * seen->x + y * seen->y + seen->depth * seen->z;
}

#endif
