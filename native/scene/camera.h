// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <glm/mat4x4.hpp>

namespace bvhlab {

enum class CameraKind { perspective, orthographic };

/// A view of the scene. The camera looks along its -Z with +Y up.
struct Camera {
    CameraKind kind = CameraKind::perspective;
    glm::dmat4 to_world{1.0};  ///< rotation and translation, no scale
    /// What the picture frames, on the plane at distance 1 (perspective) or in world units
    /// (orthographic); lens shift and sensor fit are folded in.
    double left = -1.0, right = 1.0, bottom = -1.0, top = 1.0;
    double clip_start = 0.0;      ///< distance of the near plane along -Z, in world units
    double lens_radius = 0.0;     ///< of the aperture, world units; 0: all is sharp
    double focus_distance = 1.0;  ///< along -Z, of what is sharp; world units, above 0
};

/// Throws std::invalid_argument saying what is wrong: a number that is not finite, a matrix that is
/// not a rotation and translation, a window without extent, a negative near plane or lens.
void check_camera(const Camera& camera);

}  // namespace bvhlab
