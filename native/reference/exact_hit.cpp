// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/exact_hit.h"

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>
#include <limits>

#include "scene/exact_volume.h"

namespace bvhlab {
namespace {

using Double3 = glm::dvec3;

double greatest(const Double3& v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// The corners as seen from the ray's origin; each coordinate carries the rounding of one
/// subtraction.
struct Seen {
    Double3 corners[3];

    Seen(const Ray& ray, const Triangle& triangle)
        : corners{Double3(triangle.a) - Double3(ray.origin),
                  Double3(triangle.b) - Double3(ray.origin),
                  Double3(triangle.c) - Double3(ray.origin)} {}
};

/// A volume in double and what it may be off by.
struct Volume {
    double value, bound;
};

/// det(x, p, q) of vectors that carry the rounding of one subtraction. Each of the six products of
/// three numbers is off by at most 9 * 2^-53 of itself (three differences, two products, four sums
/// and differences at most), and none exceeds the product of the greatest coordinates: 54 * 2^-53
/// of that; 2^-46 leaves room for adding three volumes.
Volume volume(const Double3& x, const Double3& p, const Double3& q) {
    const double value = x.x * (p.y * q.z - p.z * q.y) + x.y * (p.z * q.x - p.x * q.z) +
                         x.z * (p.x * q.y - p.y * q.x);
    return {value, 0x1p-46 * greatest(x) * greatest(p) * greatest(q)};
}

/// Sign of numerator - t * determinant, so that of (t of the crossing - t) where the determinant is
/// positive.
int compare(const Crossing& crossing, float t) {
    ExactSum difference = crossing.numerator;
    difference.add_scaled(crossing.determinant, -double(t));
    return difference.sign() * crossing.determinant.sign();
}

}  // namespace

bool line_meets(const Ray& ray, const Triangle& triangle) {
    const glm::vec3 corners[3] = {triangle.a, triangle.b, triangle.c};
    const Double3 direction(ray.direction);
    const Seen seen(ray, triangle);
    Volume volumes[3];
    bool positive = false;
    bool negative = false;
    for (int i = 0; i < 3; ++i) {
        volumes[i] = volume(direction, seen.corners[i], seen.corners[(i + 1) % 3]);
        positive |= volumes[i].value > volumes[i].bound;
        negative |= volumes[i].value < -volumes[i].bound;
    }
    for (int i = 0; i < 3 && !(positive && negative); ++i) {
        if (std::abs(volumes[i].value) > volumes[i].bound) continue;
        const int sign =
            exact_volume(ray.origin, ray.direction, corners[i], corners[(i + 1) % 3]).sign();
        positive |= sign > 0;
        negative |= sign < 0;
    }
    // The volumes sum to direction . normal. All three are 0 where that is 0 and the line meets the
    // triangle.
    return positive != negative;
}

Bounds bounds_of_t(const Ray& ray, const Triangle& triangle) {
    const Seen seen(ray, triangle);
    const auto& [a, b, c] = seen.corners;
    const Volume numerator = volume(a, b, c);
    Volume determinant{0.0, 0.0};
    for (int i = 0; i < 3; ++i) {
        const Volume part =
            volume(Double3(ray.direction), seen.corners[i], seen.corners[(i + 1) % 3]);
        determinant.value += part.value;
        determinant.bound += part.bound;
    }
    const double least = std::abs(determinant.value) - determinant.bound;
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (!(least > 0.0)) return {-infinity, infinity};
    // n*/d* - n/d = ((n* - n) - n/d (d* - d)) / d*, for the true n*, d* and the computed n, d.
    const double t = numerator.value / determinant.value;
    const double error = 1.001 * (numerator.bound + std::abs(t) * determinant.bound) / least;
    return {t - error, t + error};
}

Crossing crossing(const Ray& ray, const Triangle& triangle) {
    const auto& [a, b, c] = triangle;
    Crossing result;
    add_determinant(result.numerator, a, b, c);
    add_determinant(result.numerator, -ray.origin, b, c);
    add_determinant(result.numerator, -ray.origin, c, a);
    add_determinant(result.numerator, -ray.origin, a, b);
    add_determinant(result.determinant, ray.direction, b, c);
    add_determinant(result.determinant, ray.direction, c, a);
    add_determinant(result.determinant, ray.direction, a, b);
    result.t = result.numerator.value() / result.determinant.value() + 0.0;  // no -0
    return result;
}

bool in_interval(const Crossing& crossing, const Ray& ray) {
    if (compare(crossing, ray.t_min) < 0) return false;
    return ray.t_max == std::numeric_limits<float>::infinity() || compare(crossing, ray.t_max) <= 0;
}

bool nearer(const Crossing& a, const Crossing& b) {
    constexpr double unsure = 0x1p-48;  // both t are within 2^-50 of the truth
    if (std::abs(a.t - b.t) > unsure * std::max(std::abs(a.t), std::abs(b.t))) return a.t < b.t;
    ExactSum minus_determinant;
    minus_determinant.add_scaled(a.determinant, -1.0);
    ExactSum difference;
    difference.add_product(a.numerator, b.determinant);
    difference.add_product(minus_determinant, b.numerator);
    return difference.sign() * a.determinant.sign() * b.determinant.sign() < 0;
}

HitOf<double> make_hit(const Ray& ray, const Triangle& triangle, std::uint32_t index,
                       const Crossing& crossing) {
    const auto volume_of = [&](const glm::vec3& p, const glm::vec3& q) {
        return exact_volume(ray.origin, ray.direction, p, q).value();
    };
    const double determinant = crossing.determinant.value();
    return {crossing.t, volume_of(triangle.c, triangle.a) / determinant + 0.0,
            volume_of(triangle.a, triangle.b) / determinant + 0.0, index};
}

}  // namespace bvhlab
