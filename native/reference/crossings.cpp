// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/crossings.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "base/parallel.h"
#include "reference/exact_hit.h"
#include "scene/exact_volume.h"

namespace bvhlab {
namespace {

constexpr std::size_t rays_per_task = 64;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Sum of the |products| that det(x, y, z) consists of: det without its minus signs.
double sum_of_products(const glm::dvec3& x, const glm::dvec3& y, const glm::dvec3& z) {
    const glm::dvec3 a = glm::abs(x), b = glm::abs(y), c = glm::abs(z);
    return a.x * (b.y * c.z + b.z * c.y) + a.y * (b.z * c.x + b.x * c.z) +
           a.z * (b.x * c.y + b.y * c.x);
}

double condition_of(const Ray& ray, const Triangle& triangle, const Crossing& crossing) {
    const glm::dvec3 origin(ray.origin), direction(ray.direction);
    const glm::dvec3 a = glm::dvec3(triangle.a) - origin;
    const glm::dvec3 b = glm::dvec3(triangle.b) - origin;
    const glm::dvec3 c = glm::dvec3(triangle.c) - origin;
    const double determinant = sum_of_products(direction, a, b) + sum_of_products(direction, b, c) +
                               sum_of_products(direction, c, a);
    if (crossing.numerator.sign() == 0) return infinity;
    return sum_of_products(a, b, c) / std::abs(crossing.numerator.value()) +
           determinant / std::abs(crossing.determinant.value());
}

void measure(const Ray& ray, const Triangle& triangle, std::size_t i, Crossings& result) {
    const Crossing found = crossing(ray, triangle);
    if (found.determinant.sign() == 0) {
        result.meets[i] = 0;
        result.t[i] = result.u[i] = result.v[i] = nan;
        result.margin[i] = -infinity;
        result.condition[i] = infinity;
        return;
    }
    const HitOf<double> hit = make_hit(ray, triangle, no_triangle, found);
    const double w = exact_volume(ray.origin, ray.direction, triangle.b, triangle.c).value() /
                     found.determinant.value();
    result.meets[i] = line_meets(ray, triangle);
    result.t[i] = hit.t;
    result.u[i] = hit.u;
    result.v[i] = hit.v;
    result.margin[i] = std::min({w, hit.u, hit.v});
    result.condition[i] = condition_of(ray, triangle, found);
}

bool is_tie(const Ray& ray, const Triangle& first, const Triangle& second) {
    if (!line_meets(ray, first) || !line_meets(ray, second)) return false;
    const Crossing a = crossing(ray, first), b = crossing(ray, second);
    return !nearer(a, b) && !nearer(b, a);
}

}  // namespace

Crossings crossings(const Mesh& mesh, const RayBatch& rays,
                    std::span<const std::uint32_t> triangles, int threads, Token& token) {
    token.begin("crossings");
    const std::size_t count = rays.size();
    Crossings result{Array<std::uint8_t>(count), Array<double>(count), Array<double>(count),
                     Array<double>(count),       Array<double>(count), Array<double>(count)};
    with_threads(threads, [&] {
        parallel_for_each(count, rays_per_task, token, [&](std::size_t i) {
            measure(rays[i], mesh.triangle(triangles[i]), i, result);
        });
    });
    return result;
}

Array<std::uint8_t> exact_ties(const Mesh& mesh, const RayBatch& rays,
                               std::span<const std::uint32_t> first,
                               std::span<const std::uint32_t> second, int threads, Token& token) {
    token.begin("exact ties");
    Array<std::uint8_t> result(rays.size());
    with_threads(threads, [&] {
        parallel_for_each(rays.size(), rays_per_task, token, [&](std::size_t i) {
            result[i] = is_tie(rays[i], mesh.triangle(first[i]), mesh.triangle(second[i]));
        });
    });
    return result;
}

}  // namespace bvhlab
