// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/reorder.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "build/morton.h"
#include "build/radix_sort.h"

namespace bvhlab {
namespace {

constexpr int bits_per_axis = 13;

/// Cells of a coordinate in [0, 1]; what lies outside is clamped.
std::uint64_t cell(float coordinate) {
    constexpr float last = float((1 << bits_per_axis) - 1);
    return std::uint64_t(std::clamp(coordinate, 0.0F, 1.0F) * last);
}

/// Interleaves three cells, x highest.
std::uint64_t interleave(const glm::vec3& position) {
    return spread_by_three(cell(position.x)) << 2 | spread_by_three(cell(position.y)) << 1 |
           spread_by_three(cell(position.z));
}

/// The 32-bit key: three levels of the origin (9 bits), then levels of origin and direction in
/// turn, from the highest; the last direction level is cut to x and y.
std::uint32_t ray_key(const glm::vec3& origin, const glm::vec3& direction) {
    const std::uint64_t o = interleave(origin), d = interleave(direction);
    const auto level = [](std::uint64_t code, int index) {
        return std::uint32_t(code >> (3 * (bits_per_axis - 1 - index))) & 7U;
    };
    std::uint32_t key = level(o, 0) << 6 | level(o, 1) << 3 | level(o, 2);
    for (int i = 0; i < 3; ++i) key = key << 6 | level(o, 3 + i) << 3 | level(d, i);
    return key << 5 | level(o, 6) << 2 | level(d, 3) >> 1;
}

}  // namespace

RayOrder order_rays(const RayBatch& rays, const Box& bounds, const Token& token) {
    const Stopwatch key_watch;
    RayOrder result{Array<std::uint32_t>(rays.size()), 0.0, 0.0};
    Array<std::uint32_t> keys(rays.size());
    const glm::vec3 extent = bounds.upper - bounds.lower;
    const float longest = std::max(extent.x, std::max(extent.y, extent.z));
    const float scale = longest > 0.0F ? 1.0F / longest : 0.0F;
    parallel_for_each(rays.size(), 4096, token, [&](std::size_t i) {
        const glm::vec3 d = rays.directions[i];
        const glm::vec3 size = glm::abs(d);
        const glm::vec3 scaled = d / std::max(size.x, std::max(size.y, size.z));
        const glm::vec3 unit =
            scaled / std::sqrt(scaled.x * scaled.x + scaled.y * scaled.y + scaled.z * scaled.z);
        keys[i] = ray_key((rays.origins[i] - bounds.lower) * scale, 0.5F * (unit + 1.0F));
        result.order[i] = std::uint32_t(i);
    });
    result.key_seconds = key_watch.seconds();

    const Stopwatch sort_watch;
    radix_sort(keys, result.order, 32, token);
    result.sort_seconds = sort_watch.seconds();
    return result;
}

}  // namespace bvhlab
