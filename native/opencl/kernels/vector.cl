// SPDX-License-Identifier: GPL-3.0-or-later
// Vectors and elementary functions with the host's arithmetic, operation by operation (GLM's order
// of additions; std::min and std::max, which differ from fmin and fmax on NaN). In memory vectors
// are packed.

/// What functions are that are large and called from several places: a CPU's driver would copy them
/// to each and compile for long (PoCL a third longer, for nothing); a GPU's knows what is best.
#ifdef IS_GPU
#define CALLED static
#else
#define CALLED static __attribute__((noinline))
#endif

// --- numbers ------------------------------------------------------------------------------------

#define PI 3.14159265358979323846
#define PI_F 3.14159265358979323846F

static float square_root(float x) {
    return (float)sqrt((double)x);
}

static float least_f(float a, float b) {
    return b < a ? b : a;
}
static float most_f(float a, float b) {
    return a < b ? b : a;
}
static double least_d(double a, double b) {
    return b < a ? b : a;
}
static double most_d(double a, double b) {
    return a < b ? b : a;
}
static float clamp_f(float x, float low, float high) {
    return x < low ? low : high < x ? high : x;
}
static double clamp_d(double x, double low, double high) {
    return x < low ? low : high < x ? high : x;
}

/// The number next to a positive one, on the side of 0.
static double next_below(double x) {
    return as_double(as_long(x) - 1L);
}

/// x (1 - a) + y a
static float mix_f(float x, float y, float a) {
    return x * (1.0F - a) + y * a;
}
static double mix_d(double x, double y, double a) {
    return x * (1.0 - a) + y * a;
}

/// Cosine (x) and sine (y) of an angle of a few turns at most: Taylor's series on [-pi/4, pi/4],
/// whose first term left out is below 2^-60 of the result, after whole quarter turns were taken off
/// in two parts (Cody & Waite 1980), the first of which has 33 bits so that its products are exact.
/// Within 0.9 units in the last place (measured from -3.2 to 6.3, where 97 of 100 have glibc's
/// bits), and the same on every device, which the built-in functions are not.
CALLED double2 turn_of(double angle) {
    const double quarter_high = 0x1.921fb544p+0, quarter_low = 0x1.0b4611a626331p-34;
    const double quarters = rint(angle * (2.0 / PI));
    const double high = angle - quarters * quarter_high, low = quarters * quarter_low;
    const double r = high - low, lost = (high - r) - low;
    const double z = r * r;
    const double s =
        r * z *
        (-1.0 / 6.0 +
         z * (1.0 / 120.0 +
              z * (-1.0 / 5040.0 +
                   z * (1.0 / 362880.0 +
                        z * (-1.0 / 39916800.0 +
                             z * (1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0 +
                                                            z * (1.0 / 355687428096000.0))))))));
    const double c =
        z * z *
        (1.0 / 24.0 +
         z * (-1.0 / 720.0 + z * (1.0 / 40320.0 + z * (-1.0 / 3628800.0 +
                                                       z * (1.0 / 479001600.0 +
                                                            z * (-1.0 / 87178291200.0 +
                                                                 z * (1.0 / 20922789888000.0)))))));
    const double drop = 0.5 * z, rest = 1.0 - drop;
    const double sine = r + (s + lost * rest);
    const double cosine = rest + (((1.0 - rest) - drop) + (c - r * lost));
    switch ((int)quarters & 3) {
        case 0:
            return (double2)(cosine, sine);
        case 1:
            return (double2)(-sine, cosine);
        case 2:
            return (double2)(-cosine, -sine);
        default:
            return (double2)(sine, -cosine);
    }
}

// --- float vectors ------------------------------------------------------------------------------

static float3 load_f(global const float* values, size_t index) {
    return vload3(index, values);
}
static void store_f(float3 value, global float* values, size_t index) {
    vstore3(value, index, values);
}
static float3 all_f(float x) {
    return (float3)(x, x, x);
}
static float dot_f(float3 a, float3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static float3 over_f(float3 a, float b) {
    return (float3)(divide(a.x, b), divide(a.y, b), divide(a.z, b));
}
static float3 quotients_f(float3 a, float3 b) {
    return (float3)(divide(a.x, b.x), divide(a.y, b.y), divide(a.z, b.z));
}
static float3 unit_f(float3 v) {
    return v * divide(1.0F, square_root(dot_f(v, v)));
}
static float3 least_of_f(float3 a, float3 b) {
    return (float3)(least_f(a.x, b.x), least_f(a.y, b.y), least_f(a.z, b.z));
}
static float3 most_of_f(float3 a, float3 b) {
    return (float3)(most_f(a.x, b.x), most_f(a.y, b.y), most_f(a.z, b.z));
}
static bool is_black(float3 color) {
    return color.x == 0.0F && color.y == 0.0F && color.z == 0.0F;
}
/// Of linear Rec. 709 RGB.
static double luminance(float3 color) {
    return 0.2126 * (double)color.x + 0.7152 * (double)color.y + 0.0722 * (double)color.z;
}

// --- double vectors -----------------------------------------------------------------------------

static double3 load_d(global const double* values) {
    return vload3(0, values);
}
static double3 all_d(double x) {
    return (double3)(x, x, x);
}
static double dot_d(double3 a, double3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static double length_d(double3 v) {
    return sqrt(dot_d(v, v));
}
static double3 unit_d(double3 v) {
    return v * (1.0 / sqrt(dot_d(v, v)));
}
static double3 cross_d(double3 a, double3 b) {
    return (double3)(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
}
static bool is_zero_d(double3 v) {
    return v.x == 0.0 && v.y == 0.0 && v.z == 0.0;
}
/// The matrix of these columns, times v.
static double3 times_d(double3 x, double3 y, double3 z, double3 v) {
    return x * v.x + y * v.y + z * v.z;
}
