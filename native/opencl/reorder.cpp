// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/reorder.h"

#include <algorithm>

#include "opencl/radix_sort.h"

namespace bvhlab::opencl {
namespace {

constexpr int key_bits = 32;

/// KeySpace of reorder.cl; the arithmetic of RayKeys.
struct KeySpace {
    double lower[3];
    double scale;

    explicit KeySpace(const Box& scene) : lower{scene.lower.x, scene.lower.y, scene.lower.z} {
        const glm::dvec3 extent = glm::dvec3(scene.upper) - glm::dvec3(scene.lower);
        const double longest = std::max(extent.x, std::max(extent.y, extent.z));
        scale = longest > 0.0 ? 1.0 / longest : 0.0;
    }
};
static_assert(sizeof(KeySpace) == 32);

}  // namespace

Buffer<std::uint32_t> order_rays(Commands& commands, const Buffer<Ray>& rays, std::size_t count,
                                 Reorder order, const Box& scene) {
    Program program(commands.device(), {{"ray.cl", "reorder.cl"}, ""});
    auto keys = commands.buffer<std::uint32_t>(count);
    auto indices = commands.buffer<std::uint32_t>(count);
    commands.stage("key");
    commands.run(program["compute_ray_keys"], count, rays, std::uint32_t(count),
                 std::uint32_t(order), KeySpace(scene), RayKeys::ray_length, keys, indices);
    commands.stage("sort");
    radix_sort(commands, keys, indices, count, key_bits);
    return indices;
}

}  // namespace bvhlab::opencl
