// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/lattice.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

namespace bvhlab {
namespace {

constexpr int no_bit = 1000;

/// Exponent of the lowest bit that is set; no_bit for 0.
int lowest_bit(float value) {
    if (value == 0.0F) return no_bit;
    const auto bits = std::bit_cast<std::uint64_t>(double(value));  // a normal number
    return int(bits >> 52 & 0x7FF) - 1075 + std::countr_zero(bits | std::uint64_t(1) << 52);
}

/// value / 2^exponent, a whole number, where it is below 2^61.
bool to_whole(float value, int exponent, std::int64_t& whole) {
    const double scaled = double(value) * power_of_two(-exponent);  // exact
    if (!(std::abs(scaled) < 0x1p61)) return false;
    whole = std::int64_t(scaled);
    return true;
}

}  // namespace

bool LatticeTriangle::set(const PreparedRay& ray, const float (&triangle)[3][3]) {
    int unit[3], direction_unit = no_bit;
    for (int axis = 0; axis < 3; ++axis) {
        const int low = lowest_bit(ray.given_direction[axis]);
        unit[axis] = std::min({lowest_bit(ray.origin[axis]), lowest_bit(triangle[0][axis]),
                               lowest_bit(triangle[1][axis]), lowest_bit(triangle[2][axis])});
        if (unit[axis] == no_bit) unit[axis] = low == no_bit ? 0 : low;  // all 0: any unit will do
        if (low != no_bit) direction_unit = std::min(direction_unit, low - unit[axis]);
    }
    for (int axis = 0; axis < 3; ++axis) {
        std::int64_t origin;
        if (!to_whole(ray.given_direction[axis], direction_unit + unit[axis], direction[axis]) ||
            !to_whole(ray.origin[axis], unit[axis], origin))
            return false;
        for (int corner = 0; corner < 3; ++corner) {
            if (!to_whole(triangle[corner][axis], unit[axis], corners[corner][axis])) return false;
            corners[corner][axis] -= origin;
        }
    }
    edge_unit = power_of_two(direction_unit + unit[0] + unit[1] + unit[2]);
    t_unit = power_of_two(-direction_unit);
    return is_within_range();
}

/// Bounds the determinants by their terms' magnitudes. An edge() has two products for each axis of
/// the direction, below 2^124 in sum, and three of them are added; a volume() has six below 2^124.
bool LatticeTriangle::is_within_range() const {
    double size[3];
    for (int axis = 0; axis < 3; ++axis)
        size[axis] = double(std::max(
            {std::abs(corners[0][axis]), std::abs(corners[1][axis]), std::abs(corners[2][axis])}));
    const double xy = size[0] * size[1];
    const double edge = std::abs(double(direction[0])) * (size[1] * size[2]) +
                        std::abs(double(direction[1])) * (size[0] * size[2]) +
                        std::abs(double(direction[2])) * xy;
    return edge < 0x1p124 && xy * size[2] < 0x1p124;
}

/// With ExactSum, numerators and the area err by up to 2^-51 of themselves when they are rounded
/// (its parts leave a gap of a bit between each other: Shewchuk 1997, theorem 10), here by 2^-53,
/// the quotients by another 2^-53. So both quotients are within 2^-49 of each other, and floats
/// from all numbers within 2^-48 of one are equal only if both give that float.
LatticeAnswer lattice_plane_crossing(const LatticeTriangle& lattice, const PreparedRay& ray,
                                     PlaneCrossing& crossing) {
    const Integer128 at_b = lattice.edge(2, 0), at_c = lattice.edge(0, 1);
    const Integer128 determinant = lattice.edge(1, 2) + at_b + at_c;
    const double area = double(determinant);
    const double t = double(lattice.volume()) / area * lattice.t_unit;

    const double doubt = 0x1p-48 * std::abs(t);
    if (t + doubt < double(ray.given_t_min) || t - doubt > double(ray.given_t_max))
        return LatticeAnswer::outside;
    if (t - doubt < double(ray.given_t_min) || t + doubt > double(ray.given_t_max))
        return LatticeAnswer::unknown;

    crossing = {t / ray.unscale, double(at_b) / area, double(at_c) / area};
    const auto is_clear = [](double value) {
        return float(value * (1.0 - 0x1p-48)) == float(value * (1.0 + 0x1p-48));
    };
    return is_clear(crossing.t) && is_clear(crossing.u) && is_clear(crossing.v)
               ? LatticeAnswer::inside
               : LatticeAnswer::unknown;
}

}  // namespace bvhlab
