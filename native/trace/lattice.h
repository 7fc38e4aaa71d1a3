// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "trace/intersect.h"

namespace bvhlab {

__extension__ using Integer128 = __int128;  // GCC and Clang have it on every 64-bit processor

/// Whether conversion to double keeps the value.
inline bool is_double(Integer128 value) {
    return value == 0 || Integer128(double(value)) == value;
}

/// A ray and a triangle in whole numbers, which are added and multiplied without rounding. Floats
/// are multiples of powers of two, so corners and origin are whole in a unit for each axis, and the
/// direction is in those units times one of its own. A determinant has a factor of each axis in
/// every product, so all its products have one unit. Coordinates fit unless their bits lie very far
/// apart: 40 bits on each axis always do, and a float has 24.
struct LatticeTriangle {
    std::int64_t direction[3];   ///< the given one
    std::int64_t corners[3][3];  ///< [corner][axis], less the origin
    double edge_unit, t_unit;    ///< what a 1 of edge(), and of volume() / edge(), stands for

    /// False where the coordinates, or the sum of three edge(), do not fit.
    [[nodiscard]] bool set(const PreparedRay& ray, const float (&triangle)[3][3]);

    /// det(direction, from, to) of two corners: an edge function times direction[kz].
    Integer128 edge(int from, int to) const {
        return determinant(direction, corners[from], corners[to]);
    }

    /// det(a, b, c) of the corners.
    Integer128 volume() const { return determinant(corners[0], corners[1], corners[2]); }

private:
    bool is_within_range() const;

    static Integer128 determinant(const std::int64_t (&x)[3], const std::int64_t (&y)[3],
                                  const std::int64_t (&z)[3]) {
        const auto minor = [&](int i, int j) {
            return Integer128(y[i]) * z[j] - Integer128(y[j]) * z[i];
        };
        return x[0] * minor(1, 2) + x[1] * minor(2, 0) + x[2] * minor(0, 1);
    }
};

/// What lattice arithmetic says of a crossing.
enum class LatticeAnswer { unknown, outside, inside };

/// exact_plane_crossing() in lattice arithmetic: what it says becomes the same floats. `unknown`
/// where the quotients' doubles do not tell.
LatticeAnswer lattice_plane_crossing(const LatticeTriangle& lattice, const PreparedRay& ray,
                                     PlaneCrossing& crossing);

}  // namespace bvhlab
