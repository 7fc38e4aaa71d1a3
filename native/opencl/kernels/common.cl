// SPDX-License-Identifier: GPL-3.0-or-later
// What every program begins with.

#pragma OPENCL FP_CONTRACT OFF
#pragma OPENCL EXTENSION cl_khr_fp64 : enable

// --- types of the host, member for member
// ---------------------------------------------------------

/// scene/box.h
typedef struct {
    float lower[3];
    float upper[3];
} Box;

#define NO_TRIANGLE 0xFFFFFFFFU

// --- arithmetic ---------------------------------------------------------------------------------

/// a / b correctly rounded on every device: the quotient in double has more than twice the bits, so
/// rounding it once more does no harm (Figueroa 1995).
inline float divide(float a, float b) {
    return (float)((double)a / (double)b);
}

// --- boxes --------------------------------------------------------------------------------------

inline Box empty_box(void) {
    return (Box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

/// unite of scene/box.h. Of 0 and -0 the first is taken, as there; fmin and fmax leave it open.
inline Box unite(Box a, Box b) {
    for (int axis = 0; axis < 3; ++axis) {
        a.lower[axis] = b.lower[axis] < a.lower[axis] ? b.lower[axis] : a.lower[axis];
        a.upper[axis] = a.upper[axis] < b.upper[axis] ? b.upper[axis] : a.upper[axis];
    }
    return a;
}

/// Box::half_area: 0 for an empty box; in double, in the host's order.
inline double half_area(Box box) {
    if (box.lower[0] > box.upper[0] || box.lower[1] > box.upper[1] || box.lower[2] > box.upper[2])
        return 0.0;
    const double x = (double)box.upper[0] - (double)box.lower[0];
    const double y = (double)box.upper[1] - (double)box.lower[1];
    const double z = (double)box.upper[2] - (double)box.lower[2];
    return x * y + y * z + z * x;
}
