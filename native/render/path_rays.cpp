// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/path_rays.h"

#include <algorithm>

#include "base/parallel.h"

namespace bvhlab {

PathRays path_rays(const View& view, const PathSettings& paths, std::uint32_t sample, int threads,
                   Token& token) {
    constexpr std::size_t batch = std::size_t(1) << 16;
    const std::size_t pixels = std::size_t(view.raster.width) * view.raster.height;
    PathTracer tracer(view, {paths, Reorder::off, false});
    PathRays rays;
    rays.secondary.resize(paths.depth);
    rays.shadow.resize(paths.depth + 1);
    token.begin("generating rays");
    with_threads(threads, [&] {
        for (std::size_t first = 0; first < pixels; first += batch) {
            tracer.trace({first, std::min(batch, pixels - first), sample, 1}, token, &rays);
            token.advance(float(std::min(first + batch, pixels)) / float(pixels));
        }
    });
    return rays;
}

double path_rays_bytes(const PathSettings& paths) {
    const double ray = 2.0 * sizeof(glm::vec3);
    const double shadow = (ray + sizeof(float)) * paths.shadow_rays;
    return ray + paths.depth * ray + (paths.depth + 1.0) * shadow;
}

}  // namespace bvhlab
