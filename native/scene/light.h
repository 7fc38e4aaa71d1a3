// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <numbers>

namespace bvhlab {

enum class LightKind { point, sun, spot, area };
enum class LightShape { rectangle, disk };

/// A lamp in Blender's units. It shines along its -Z (a point in all directions) and is invisible
/// to the camera.
struct Light {
    LightKind kind = LightKind::point;
    glm::dmat4 to_world{1.0};  ///< rotation and translation; scale belongs into the sizes
    glm::vec3 color{1.0F};     ///< linear RGB times power in W; for a sun times irradiance in W/m2
    double size_x = 0.0;  ///< radius (point, spot), angular diameter in radians (sun), width (area)
    double size_y = 0.0;  ///< height (area)
    LightShape shape = LightShape::rectangle;  ///< of an area; a disk is the inscribed ellipse
    double spot_angle = std::numbers::pi;      ///< full angle of a spot's cone, in radians
    double spot_blend = 0.0;                   ///< share of the cone that fades out, 0 to 1
};

/// Throws std::invalid_argument saying what is wrong with it.
void check_light(const Light& light);

}  // namespace bvhlab
