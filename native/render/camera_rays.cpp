// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/camera_rays.h"

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "base/parallel.h"
#include "render/sample_shapes.h"
#include "render/sampler.h"

namespace bvhlab {

namespace {

CameraRay placed(const Camera& camera, const glm::dvec3& origin, const glm::dvec3& direction) {
    return {glm::vec3(camera.to_world * glm::dvec4(origin, 1.0)),
            glm::vec3(glm::normalize(glm::dvec3(camera.to_world * glm::dvec4(direction, 0.0))))};
}

}  // namespace

CameraRay camera_ray(const Camera& camera, const Raster& raster, std::uint32_t pixel,
                     std::uint32_t sample) {
    // Choose the point of the pixel, in pixels from the top left corner.
    const Sampler random(pixel, sample, raster.seed);
    glm::dvec2 point(pixel % raster.width, pixel / raster.width);
    point += sample == 0 ? glm::dvec2(0.5) : random.pair(camera_dimension);

    // Find it in the window.
    const double x = camera.left + (camera.right - camera.left) * (point.x / raster.width);
    const double y = camera.top + (camera.bottom - camera.top) * (point.y / raster.height);

    // Start on the near plane.
    const bool perspective = camera.kind == CameraKind::perspective;
    const glm::dvec3 direction = perspective ? glm::dvec3(x, y, -1.0) : glm::dvec3(0.0, 0.0, -1.0);
    const glm::dvec3 origin =
        perspective ? direction * camera.clip_start : glm::dvec3(x, y, -camera.clip_start);
    if (camera.lens_radius == 0.0) return placed(camera, origin, direction);

    // From a point of the lens instead, to where the ray through its centre is in focus.
    const glm::dvec3 lens(camera.lens_radius * sample_disk(random.pair(lens_dimension)), 0.0);
    const glm::dvec3 centre = perspective ? glm::dvec3(0.0) : glm::dvec3(x, y, 0.0);
    const glm::dvec3 to_focus = direction * camera.focus_distance - lens;
    const glm::dvec3 start = centre + lens + to_focus * (camera.clip_start / camera.focus_distance);
    return placed(camera, start, to_focus);
}

RayArrays camera_rays(const Camera& camera, const Raster& raster, std::uint32_t sample, int threads,
                      const Token& token) {
    const std::size_t count = std::size_t(raster.width) * raster.height;
    RayArrays rays{Array<glm::vec3>(count), Array<glm::vec3>(count)};
    with_threads(threads, [&] {
        parallel_for_each(count, 4096, token, [&](std::size_t i) {
            const CameraRay ray = camera_ray(camera, raster, std::uint32_t(i), sample);
            rays.origins[i] = ray.origin;
            rays.directions[i] = ray.direction;
        });
    });
    return rays;
}

}  // namespace bvhlab
