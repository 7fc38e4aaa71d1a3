// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "base/array.h"
#include "base/token.h"
#include "scene/camera.h"

namespace bvhlab {

/// Largest width and height of a picture, so that a pixel's index fits in 32 bits.
inline constexpr std::uint32_t largest_side = 65535;

/// A ray from the near plane through a pixel; `direction` has unit length.
struct CameraRay {
    glm::vec3 origin, direction;
};

/// Size of a picture, and which of the random samples of its pixels is meant.
struct Raster {
    std::uint32_t width, height;
    std::uint32_t seed = 0;
};

/// The ray of one sample of one pixel; pixels are counted row by row from the top left.
/// Sample 0 goes through the pixel's centre, the others are spread over the pixel (box filter).
/// With a lens, rays start at random points of it and those of one point of the picture meet in the
/// focus plane. Computed in double and rounded once to float.
CameraRay camera_ray(const Camera& camera, const Raster& raster, std::uint32_t pixel,
                     std::uint32_t sample);

/// Origins and directions, by ray.
struct RayArrays {
    Array<glm::vec3> origins, directions;
};

/// One ray per pixel, row by row from the top left.
RayArrays camera_rays(const Camera& camera, const Raster& raster, std::uint32_t sample, int threads,
                      const Token& token);

}  // namespace bvhlab
