// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "base/array.h"
#include "base/token.h"
#include "bvh/wide_bvh.h"
#include "render/camera_rays.h"
#include "scene/camera.h"
#include "scene/scene.h"

namespace bvhlab {

/// Largest number of samples a pixel, so that one pixel's samples fit in a batch.
inline constexpr std::uint32_t most_samples = 65536;

struct RenderOptions {
    Raster raster;              ///< sides 1 to largest_side
    std::uint32_t samples = 1;  ///< per pixel, 1 to most_samples
    int threads = 0;            ///< 0: all
};

struct Picture {
    Array<glm::vec3> pixels;   ///< radiance, linear RGB, row by row from the top left
    std::uint64_t rays = 0;    ///< traced: primary, shadow and world rays
    double seconds = 0.0;      ///< wall-clock time of all of it
    double trace_seconds = 0;  ///< of which traversal
};

/// Renders direct light: what emits is seen, and surfaces reflect the light of lamps, emitting
/// triangles and the world that reaches them at once. Surfaces are Lambertian on both sides and
/// flat: shading uses the geometric normal. There is no indirect light.
///
/// Per sample and hit there is one shadow ray for each light that shines on it from the viewer's
/// side (of more than `most_lights_at_a_hit` lights that many are drawn by power), and one
/// cosine-distributed ray to the world unless it is black; all emitting triangles count as one
/// light.
///
/// The picture depends on scene, camera, raster and samples alone, bit for bit: not on the tree nor
/// on threads. Memory is bounded by batches of about 2^18 primary rays (or the samples of one
/// pixel). Throws Cancelled, and std::invalid_argument where the tree is of another mesh than the
/// scene.
Picture render(const Bvh& bvh, const Scene& scene, const Camera& camera,
               const RenderOptions& options, Token& token);

inline constexpr std::size_t most_lights_at_a_hit = 8;

}  // namespace bvhlab
