// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/reorder.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "base/parallel.h"
#include "build/morton.h"
#include "build/radix_sort.h"

namespace bvhlab {
namespace {

constexpr int bits_per_axis = 13;
constexpr int key_bits = 32;

/// Cell of a coordinate in [0, 1]; what lies outside is clamped, without a branch.
std::uint64_t cell(double coordinate) {
    constexpr double last = double((1 << bits_per_axis) - 1);
    return std::uint64_t(std::int64_t(std::min(std::max(coordinate, 0.0), 1.0) * last));
}

/// Interleaves three cells, x highest.
std::uint64_t interleave(const glm::dvec3& position) {
    return spread_by_three(cell(position.x)) << 2 | spread_by_three(cell(position.y)) << 1 |
           spread_by_three(cell(position.z));
}

/// Level `index` of an interleaved code, 0 the highest: three bits.
std::uint32_t level(std::uint64_t code, int index) {
    return std::uint32_t(code >> (3 * (bits_per_axis - 1 - index))) & 7U;
}

/// The highest `count` levels.
std::uint32_t levels(std::uint64_t code, int count) {
    return std::uint32_t(code >> (3 * (bits_per_axis - count)));
}

/// Without overflow or underflow for any float direction.
glm::dvec3 unit(const glm::vec3& direction) {
    return glm::normalize(glm::dvec3(direction));
}

/// 7 levels of the origin and 3 2/3 of the direction, whose [-1, 1] are mapped to [0, 1].
std::uint32_t aila_key(std::uint64_t origin, const glm::dvec3& direction) {
    const std::uint64_t towards = interleave(0.5 * (direction + 1.0));
    std::uint32_t key = levels(origin, 3);
    for (int i = 0; i < 3; ++i) key = key << 6 | level(origin, 3 + i) << 3 | level(towards, i);
    return key << 5 | level(origin, 6) << 2 | level(towards, 3) >> 1;
}

std::uint32_t origin_key(std::uint64_t origin) {
    return levels(origin, 10) << 2 | level(origin, 10) >> 1;
}

/// The direction's place on an octahedron unfolded to [0, 1]^2: the lower half is folded out over
/// the diagonals. Of any length.
glm::dvec2 unfold(const glm::dvec3& direction) {
    const glm::dvec3 size = glm::abs(direction);
    const double scale = 1.0 / (size.x + size.y + size.z);
    const bool below = direction.z < 0.0;
    const double x = below ? 1.0 - size.y * scale : size.x * scale;
    const double y = below ? 1.0 - size.x * scale : size.y * scale;
    return {0.5 * (std::copysign(x, direction.x) + 1.0),
            0.5 * (std::copysign(y, direction.y) + 1.0)};
}

/// 8 levels of the origin and 4, of two bits each, of the direction.
std::uint32_t octahedron_key(std::uint64_t origin, const glm::dvec3& direction) {
    const glm::dvec2 place = unfold(direction);
    const std::uint64_t towards = interleave({place.x, place.y, 0.0});
    std::uint32_t key = levels(origin, 4);
    for (int i = 0; i < 4; ++i) key = key << 5 | level(origin, 4 + i) << 2 | level(towards, i) >> 1;
    return key;
}

/// 5 2/3 levels of the origin and 5 of the end.
std::uint32_t two_point_key(std::uint64_t origin, std::uint64_t end) {
    std::uint32_t key = 0;
    for (int i = 0; i < 5; ++i) key = key << 6 | level(origin, i) << 3 | level(end, i);
    return key << 2 | level(origin, 5) >> 1;
}

}  // namespace

Reorder reorder_named(std::string_view name) {
    std::string known;
    for (std::size_t i = 0; i < reorder_names.size(); ++i) {
        if (name == reorder_names[i]) return Reorder(i);
        known += std::string(i ? ", " : "") + reorder_names[i];
    }
    throw std::invalid_argument("unknown ray order '" + std::string(name) +
                                "'; there are: " + known);
}

RayKeys::RayKeys(const Box& scene) : lower_(scene.lower) {
    const glm::dvec3 extent = glm::dvec3(scene.upper) - lower_;
    const double longest = std::max(extent.x, std::max(extent.y, extent.z));
    scale_ = longest > 0.0 ? 1.0 / longest : 0.0;
}

std::uint32_t RayKeys::operator()(Reorder order, const Ray& ray) const {
    const glm::dvec3 start = (glm::dvec3(ray.origin) - lower_) * scale_;
    const std::uint64_t origin = interleave(start);
    if (order == Reorder::origin) return origin_key(origin);
    if (order == Reorder::octahedron) return octahedron_key(origin, ray.direction);
    const glm::dvec3 direction = unit(ray.direction);
    if (order == Reorder::aila) return aila_key(origin, direction);
    // t is in units of the direction's length. A ray with t_max < 0 meets nothing: it stays.
    const double ends = double(ray.t_max) * glm::length(glm::dvec3(ray.direction)) * scale_;
    const double reach = std::clamp(scale_ > 0.0 ? ends : 0.0, 0.0, ray_length);
    return two_point_key(origin, interleave(start + reach * direction));
}

RayOrder order_rays(Reorder order, const RayBatch& rays, const Box& scene, const Token& token) {
    const Stopwatch key_watch;
    RayOrder result{Array<std::uint32_t>(rays.size()), 0.0, 0.0};
    Array<std::uint32_t> keys(rays.size());
    const RayKeys key(scene);
    parallel_for_each(rays.size(), 4096, token, [&](std::size_t i) {
        keys[i] = key(order, rays[i]);
        result.order[i] = std::uint32_t(i);
    });
    result.key_seconds = key_watch.seconds();

    const Stopwatch sort_watch;
    radix_sort(keys, result.order, key_bits, token);
    result.sort_seconds = sort_watch.seconds();
    return result;
}

}  // namespace bvhlab
