// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/brute_force.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>

#include "base/parallel.h"
#include "reference/exact_hit.h"

namespace bvhlab {
namespace {

// A group of rays passes over one tile of triangles after another: a tile's spheres (32 KB) stay in
// the first-level cache for the whole group.
constexpr std::size_t rays_per_group = 16;
constexpr std::size_t triangles_per_block = 64;
constexpr std::size_t triangles_per_tile = 32 * triangles_per_block;

constexpr float infinity = std::numeric_limits<float>::infinity();

/// Relative error granted to the filter: 8 roundings of 2^-24; filter_of() says why that is enough.
constexpr double filter_error = 0x1p-21;

/// A sphere around each triangle, coordinate by coordinate, filled up to whole blocks by spheres
/// that no line meets.
struct Spheres {
    Array<float> x, y, z, radius;
};

/// Two unit vectors across the ray: a sphere meets the ray's line only where its centre is, along
/// each of them, no farther from the origin than its radius.
struct RayFilter {
    glm::vec3 across[2];
    float origin[2];  ///< the ray's origin along each vector
    float margin;     ///< added to every radius
};

double sum_of_sizes(const glm::dvec3& v) {
    return std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
}

Spheres spheres_around(const Mesh& mesh, const Token& token) {
    const std::size_t blocks = (mesh.size() + triangles_per_block - 1) / triangles_per_block;
    const std::size_t count = blocks * triangles_per_block;
    Spheres spheres{Array<float>(count), Array<float>(count), Array<float>(count),
                    Array<float>(count)};
    parallel_for_each(count, triangles_per_tile, token, [&](std::size_t i) {
        const Box box = mesh.box(std::min(i, mesh.size() - 1));
        const glm::vec3 centre((glm::dvec3(box.lower) + glm::dvec3(box.upper)) * 0.5);
        const Triangle corners = mesh.triangle(std::min(i, mesh.size() - 1));
        double radius = 0.0;
        for (const glm::vec3& corner : {corners.a, corners.b, corners.c})
            radius = std::max(radius, glm::distance(glm::dvec3(corner), glm::dvec3(centre)));
        radius += filter_error * (radius + sum_of_sizes(centre)) +
                  8.0 * std::numeric_limits<float>::min();
        spheres.x[i] = centre.x;
        spheres.y[i] = centre.y;
        spheres.z[i] = centre.z;
        spheres.radius[i] = i < mesh.size() ? float(radius) : -infinity;
    });
    return spheres;
}

/// The filter must let pass every sphere of centre c and radius r that holds a point p of the line.
/// With e one of the vectors as rounded to float, (c - o) . e = (c - p) . e + (p - o) . e; the
/// first is at most r (1 + 2^-24), the second 2^-24 |p - o| for p - o is perpendicular to e but for
/// the rounding of e. Computing c . e - o . e in float adds 3 * 2^-24 |c| for the products and
/// sums, 2^-24 |o| for o . e and 2^-24 (|c| + |o|) for the difference. With |p - o| <= |c| + r +
/// |o| that is less than r + 2^-21 (r + |c|) from the sphere and 2^-21 |o| from the ray, to which
/// the sphere adds 8 times the least normal float for products that underflow.
RayFilter filter_of(const Ray& ray) {
    const glm::dvec3 along = glm::normalize(glm::dvec3(ray.direction));
    const glm::dvec3 sizes = glm::abs(along);
    glm::dvec3 axis(0.0);
    axis[sizes.x <= sizes.y && sizes.x <= sizes.z ? 0 : sizes.y <= sizes.z ? 1 : 2] = 1.0;
    const glm::dvec3 first = glm::normalize(glm::cross(along, axis));
    const glm::dvec3 second = glm::cross(along, first);

    RayFilter filter{{glm::vec3(first), glm::vec3(second)}, {0.0F, 0.0F}, infinity};
    const glm::dvec3 origin(ray.origin);
    if (sum_of_sizes(origin) > 1e37) return filter;  // would overflow: let everything pass
    for (int i = 0; i < 2; ++i)
        filter.origin[i] = float(glm::dot(origin, glm::dvec3(filter.across[i])));
    filter.margin = float(filter_error * sum_of_sizes(origin));
    return filter;
}

/// Sets pass[i] where sphere `first` + i may meet the line; true where any does. Compiled to SIMD
/// code.
bool filter_block(const Spheres& spheres, std::size_t first, const RayFilter& filter,
                  std::uint32_t (&pass)[triangles_per_block]) {
    const float* x = spheres.x.data() + first;
    const float* y = spheres.y.data() + first;
    const float* z = spheres.z.data() + first;
    const float* radius = spheres.radius.data() + first;
    const glm::vec3 e = filter.across[0];
    const glm::vec3 f = filter.across[1];
    const float e_origin = filter.origin[0];
    const float f_origin = filter.origin[1];
    const float margin = filter.margin;
    std::uint32_t any = 0;
    for (std::size_t i = 0; i < triangles_per_block; ++i) {
        const float reach = radius[i] + margin;
        const float along_e = (x[i] * e.x + y[i] * e.y + z[i] * e.z) - e_origin;
        const float along_f = (x[i] * f.x + y[i] * f.y + z[i] * f.z) - f_origin;
        pass[i] =
            std::uint32_t(std::abs(along_e) <= reach) & std::uint32_t(std::abs(along_f) <= reach);
        any |= pass[i];
    }
    return any != 0;
}

/// One ray on its way over the triangles.
struct Search {
    Ray ray;
    RayFilter filter;
    std::optional<Crossing> nearest;
    std::uint32_t triangle = no_triangle;

    explicit Search(const Ray& r) : ray(r), filter(filter_of(r)) {}

    void test(const Mesh& mesh, std::uint32_t index) {
        const Triangle corners = mesh.triangle(index);
        if (!line_meets(ray, corners)) return;
        const Bounds t = bounds_of_t(ray, corners);
        if (t.high < ray.t_min || t.low > farthest()) return;
        Crossing found = crossing(ray, corners);
        if (!in_interval(found, ray) || (nearest && !nearer(found, *nearest))) return;
        nearest = std::move(found);
        triangle = index;
    }

    /// No t above this can be the answer.
    double farthest() const {
        constexpr double margin = 1.0 + 0x1p-48;  // Crossing::t is a rounded value
        return nearest ? nearest->t * margin : double(ray.t_max);
    }
};

/// Triangles in the order of their indices, so that the first of equal t is the one kept.
void test_tile(const Mesh& mesh, const Spheres& spheres, std::size_t begin, bool any_hit,
               Search& search) {
    const std::size_t end = std::min(begin + triangles_per_tile, spheres.x.size());
    std::uint32_t pass[triangles_per_block];
    for (std::size_t first = begin; first < end; first += triangles_per_block) {
        if (!filter_block(spheres, first, search.filter, pass)) continue;
        for (std::size_t i = 0; i < triangles_per_block; ++i) {
            if (!pass[i]) continue;
            search.test(mesh, std::uint32_t(first + i));
            if (any_hit && search.nearest) return;
        }
    }
}

void store(const Mesh& mesh, const Search& search, std::size_t i, HitsOf<double>& hits) {
    hits.occluded[i] = search.nearest.has_value();
    if (hits.t.empty()) return;
    HitOf<double> hit{infinity, 0.0, 0.0, no_triangle};
    if (search.nearest)
        hit =
            make_hit(search.ray, mesh.triangle(search.triangle), search.triangle, *search.nearest);
    hits.t[i] = hit.t;
    hits.u[i] = hit.u;
    hits.v[i] = hit.v;
    hits.triangle[i] = hit.triangle;
}

}  // namespace

HitsOf<double> brute_force(const Mesh& mesh, const RayBatch& rays, bool any_hit, int threads,
                           Token& token) {
    token.begin("brute force");
    const std::size_t closest = any_hit ? 0 : rays.size();
    HitsOf<double> hits;
    hits.t = Array<double>(closest);
    hits.u = Array<double>(closest);
    hits.v = Array<double>(closest);
    hits.triangle = Array<std::uint32_t>(closest);
    hits.occluded = Array<std::uint8_t>(rays.size());

    const Stopwatch watch;
    with_threads(threads, [&] {
        const Spheres spheres = spheres_around(mesh, token);
        const std::size_t groups = (rays.size() + rays_per_group - 1) / rays_per_group;
        std::atomic<std::size_t> done = 0;
        parallel_for_each(groups, 1, token, [&](std::size_t group) {
            const std::size_t begin = group * rays_per_group;
            const std::size_t end = std::min(begin + rays_per_group, rays.size());
            std::vector<Search> searches;
            for (std::size_t i = begin; i < end; ++i) searches.emplace_back(rays[i]);
            for (std::size_t tile = 0; tile < spheres.x.size(); tile += triangles_per_tile) {
                token.check();
                for (Search& search : searches)
                    if (!any_hit || !search.nearest)
                        test_tile(mesh, spheres, tile, any_hit, search);
            }
            for (std::size_t i = begin; i < end; ++i) store(mesh, searches[i - begin], i, hits);
            token.advance(float(++done) / float(groups));
        });
    });
    hits.traverse_seconds = watch.seconds();
    return hits;
}

}  // namespace bvhlab
