// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/exact_hit.h"

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>

namespace bvhlab {
namespace {

using Double3 = glm::dvec3;

/// Adds det(x, y, z).
void add_determinant(ExactSum& sum, const glm::vec3& x, const glm::vec3& y, const glm::vec3& z) {
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        const int k = (i + 2) % 3;
        sum.add_product(x[i], y[j], z[k]);
        sum.add_product(-x[i], y[k], z[j]);
    }
}

/// det(direction, p - origin, q - origin), without rounding.
ExactSum exact_volume(const Ray& ray, const glm::vec3& p, const glm::vec3& q) {
    ExactSum volume;
    add_determinant(volume, ray.direction, p, q);
    add_determinant(volume, -ray.direction, p, ray.origin);
    add_determinant(volume, -ray.direction, ray.origin, q);
    return volume;
}

double greatest(const Double3& v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// A volume in double and what it may be off by.
struct Volume {
    double value, bound;
};

/// det(d, p, q) where p and q carry the rounding of one subtraction. Each of the six products of
/// three numbers is off by at most 8 * 2^-53 of itself (two differences, two products, three sums),
/// and none exceeds the product of the greatest coordinates: 48 * 2^-53 of that; 2^-47 leaves a
/// margin.
Volume volume(const Double3& d, const Double3& p, const Double3& q) {
    const double value = d.x * (p.y * q.z - p.z * q.y) + d.y * (p.z * q.x - p.x * q.z) +
                         d.z * (p.x * q.y - p.y * q.x);
    return {value, 0x1p-47 * greatest(d) * greatest(p) * greatest(q)};
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
    Double3 seen[3];
    for (int i = 0; i < 3; ++i) seen[i] = Double3(corners[i]) - Double3(ray.origin);

    Volume volumes[3];
    bool positive = false;
    bool negative = false;
    for (int i = 0; i < 3; ++i) {
        volumes[i] = volume(direction, seen[i], seen[(i + 1) % 3]);
        positive |= volumes[i].value > volumes[i].bound;
        negative |= volumes[i].value < -volumes[i].bound;
    }
    for (int i = 0; i < 3 && !(positive && negative); ++i) {
        if (std::abs(volumes[i].value) > volumes[i].bound) continue;
        const int sign = exact_volume(ray, corners[i], corners[(i + 1) % 3]).sign();
        positive |= sign > 0;
        negative |= sign < 0;
    }
    // The volumes sum to direction . normal. All three are 0 where that is 0 and the line meets the
    // triangle.
    return positive != negative;
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
    result.t = result.numerator.value() / result.determinant.value();
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
    const double determinant = crossing.determinant.value();
    return {crossing.t, exact_volume(ray, triangle.c, triangle.a).value() / determinant,
            exact_volume(ray, triangle.a, triangle.b).value() / determinant, index};
}

}  // namespace bvhlab
