// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/camera.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <stdexcept>

#include "scene/transform.h"

namespace bvhlab {
namespace {

/// Whether the axes have unit length, to the error of float32 matrices, and span space. They need
/// not be at right angles: Blender too looks through a sheared camera along its normalised axes.
bool is_unscaled(const glm::dmat4& matrix) {
    for (int axis = 0; axis < 3; ++axis)
        if (std::abs(glm::length(glm::dvec3(matrix[axis])) - 1.0) > 1e-4) return false;
    return std::abs(glm::determinant(matrix)) > 1e-6;
}

}  // namespace

void check_camera(const Camera& camera) {
    if (!is_affine(camera.to_world))
        throw std::invalid_argument(
            "the camera's to_world must be a finite (4, 4) matrix with last row 0, 0, 0, 1");
    if (!is_unscaled(camera.to_world))
        throw std::invalid_argument(
            "the camera's to_world must have independent axes of unit length, without scale");
    if (!std::isfinite(camera.left) || !std::isfinite(camera.right) ||
        !std::isfinite(camera.bottom) || !std::isfinite(camera.top))
        throw std::invalid_argument("the camera's window is not finite");
    if (!(camera.left < camera.right) || !(camera.bottom < camera.top))
        throw std::invalid_argument(
            "the camera's window (left, right, bottom, top) has no extent: left must be below "
            "right, "
            "and bottom below top");
    if (!std::isfinite(camera.clip_start) || camera.clip_start < 0.0)
        throw std::invalid_argument("the camera's clip_start must be finite and not negative");
    if (!std::isfinite(camera.lens_radius) || camera.lens_radius < 0.0)
        throw std::invalid_argument("the camera's lens_radius must be finite and not negative");
    if (!std::isfinite(camera.focus_distance) || !(camera.focus_distance > 0.0))
        throw std::invalid_argument("the camera's focus_distance must be finite and above 0");
}

}  // namespace bvhlab
