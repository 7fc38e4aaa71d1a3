// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "base/array.h"
#include "render/film.h"
#include "trace/ray.h"

namespace bvhlab {

/// Which paths are traced.
struct PathSettings {
    std::uint32_t depth = 8;        ///< bounces after the first hit, 0 (direct light) to most_depth
    std::uint32_t shadow_rays = 2;  ///< light samples at each hit, 0 to most_shadow_rays
};

/// Living paths, each about to trace its next ray; in ascending order of `id`.
struct Paths {
    Array<glm::vec3> origins, directions;  ///< of that ray; directions have unit length
    Array<glm::vec3> throughput;           ///< of light that comes along the ray; black: has ended
    Array<glm::vec3> normals;  ///< of the surface that the path left, on the side it came from
    Array<float> pdf;          ///< density of the direction; 0 where no light sample could find it
    Array<float> travelled;    ///< since the last bounce, through surfaces passed straight through
    Array<std::uint32_t> id;   ///< in the PathRange

    std::size_t size() const { return id.size(); }
    void resize(std::size_t count);

    /// Copies path `from` of `other` to `to`.
    void copy(const Paths& other, std::size_t from, std::size_t to);
};

/// Rays to points of lights, a fixed number for each path, with the radiance that each brings to
/// its pixel where nothing is in between; black where there is nothing to bring.
struct LightPaths {
    Array<glm::vec3> origins, directions;
    Array<float> t_max;
    Array<glm::vec3> radiance;

    std::size_t size() const { return radiance.size(); }
    void resize(std::size_t count);
};

/// One batch of paths on its way through the stages.
struct Wave {
    PathRange range;
    std::uint32_t bounce = 0;   ///< 0 for camera rays
    Paths paths;                ///< alive
    Hits hits;                  ///< of their rays
    LightPaths light;           ///< from these hits, PathSettings::shadow_rays for each path
    Array<glm::vec3> radiance;  ///< gathered so far, by id
    Array<PassValues> passes;   ///< by id, or empty where they are not wanted
};

}  // namespace bvhlab
