// SPDX-License-Identifier: GPL-3.0-or-later
// Points of disks and directions of cones, as render/sample_shapes.h draws them.

/// A right-handed basis whose third axis is the unit vector z (Duff et al. 2017), times v.
static double3 in_basis_about(double3 z, double3 v) {
    const double sign = copysign(1.0, z.z);
    const double a = -1.0 / (sign + z.z);
    const double b = z.x * z.y * a;
    return times_d((double3)(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x),
                   (double3)(b, sign + z.y * z.y * a, -z.y), z, v);
}

/// Point of the unit disk, uniform by area (Shirley & Chiu 1997).
static double2 sample_disk(double2 random) {
    const double2 square = 2.0 * random - 1.0;
    if (square.x == 0.0 && square.y == 0.0) return (double2)(0.0, 0.0);
    const bool wide = fabs(square.x) > fabs(square.y);
    const double radius = wide ? square.x : square.y;
    const double angle =
        wide ? PI / 4.0 * (square.y / square.x) : PI / 2.0 - PI / 4.0 * (square.x / square.y);
    return radius * turn_of(angle);
}

/// Unit direction about `normal` with density cos / pi.
static double3 sample_cosine(double3 normal, double2 random) {
    const double2 disk = sample_disk(random);
    const double height = sqrt(most_d(0.0, 1.0 - (disk.x * disk.x + disk.y * disk.y)));
    return in_basis_about(normal, (double3)(disk, height));
}

/// Unit direction within a cone about `axis`, uniform by solid angle; its cosine is 1 - `sagitta`.
static double3 sample_cone(double3 axis, double sagitta, double2 random) {
    const double drop = random.x * sagitta;
    const double sine = sqrt(most_d(0.0, drop * (2.0 - drop)));
    const double2 turn = turn_of(2.0 * PI * random.y);
    return in_basis_about(axis, (double3)(sine * turn.x, sine * turn.y, 1.0 - drop));
}
