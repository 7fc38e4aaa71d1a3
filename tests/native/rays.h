// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <random>
#include <vector>

#include "meshes.h"
#include "trace/ray.h"

namespace bvhlab::test {

inline constexpr float infinity = std::numeric_limits<float>::infinity();

/// Rays held as arrays.
struct Rays {
    std::vector<glm::vec3> origins, directions;
    std::vector<float> t_min{0.0F}, t_max{infinity};

    RayBatch batch() const { return {origins, directions, t_min, t_max}; }
    void add(glm::vec3 origin, glm::vec3 direction) {
        origins.push_back(origin);
        directions.push_back(direction);
    }
};

inline Rays random_rays(std::size_t count, const Box& bounds, std::uint32_t seed) {
    std::mt19937 random(seed);
    Rays rays;
    const glm::vec3 size = bounds.upper - bounds.lower;
    for (std::size_t i = 0; i < count; ++i)
        rays.add(bounds.lower + size * uniform_vector(random, -0.2F, 1.2F),
                 uniform_vector(random, -1.0F, 1.0F));
    return rays;
}

/// Rays with zero, negative zero, tiny and huge components, from a corner of each of the first two
/// triangles (of the first under sanitizers), along faces.
inline Rays awkward_rays(const Mesh& mesh) {
#ifdef BVHLAB_SANITIZE
    const std::size_t triangles = 1;
#else
    const std::size_t triangles = 2;
#endif
    const float parts[] = {0.0F, -0.0F, 1.0F, -1.0F, 1e-42F, -1e-30F, 1e20F};
    Rays rays;
    for (std::size_t i = 0; i < mesh.size() && i < triangles; ++i)
        for (const float x : parts)
            for (const float y : parts)
                for (const float z : parts)
                    if (x != 0.0F || y != 0.0F || z != 0.0F)
                        rays.add(mesh.triangle(i).a - glm::vec3(0.0F, 0.0F, float(i % 3)),
                                 {x, y, z});
    return rays;
}

}  // namespace bvhlab::test
