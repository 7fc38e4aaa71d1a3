// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "scene/light.h"

namespace bvhlab {

/// A random point of a light as seen from a position.
struct LightSample {
    glm::dvec3 to_light{0.0};  ///< from the position to the point; a unit direction if `distant`
    bool distant = false;      ///< a sun or the world: nothing is behind it
    /// Unshadowed, on a surface that faces the point, in W/m2, divided by the density of the
    /// sample: radiance / pdf. Black where the light does not shine to.
    glm::dvec3 irradiance{0.0};
    /// Density of the direction by solid angle; 0 where a ray in a random direction cannot find
    /// the light (a lamp without extent), so that light sampling alone counts.
    double pdf = 0.0;
};

/// A lamp that a ray meets.
struct LampHit {
    glm::dvec3 radiance;  ///< W/(m2 sr)
    double distance;      ///< from the ray's origin; infinite for a sun
    double pdf;           ///< density with which light sampling draws this direction
};

/// A lamp made ready for drawing points. Units are Blender's as Cycles takes them from Blender 4.0
/// on: a point or spot of power P has the radiant intensity P / (4 pi), of which a spot's cone
/// masks a part; a sun of strength S gives the irradiance S; an area light has the radiance
/// P / (pi A).
///
/// A point or spot with a radius is a disk that faces the position, of intensity P / (4 pi) along
/// its axis. (Cycles' "soft falloff", the default; it stays finite where the lamp touches a
/// surface, and is a sphere's look from afar.) A sun is a disk at infinity.
///
/// Geometry in a lamp's own plane does not hide it: every position sees lamps some units in the
/// last place of their coordinates and distance nearer than they are.
///
/// An extent is none where it is seen under less than about 2^-23 radians, the step of float
/// directions.
class Lamp {
public:
    explicit Lamp(const Light& light);

    /// Whether any ray can meet it.
    bool has_extent() const { return extent_ > 0.0; }

    /// Draws a point for `random` in [0, 1)^2.
    LightSample sample(const glm::dvec3& position, const glm::dvec2& random) const;

    /// What `sample` draws at `position`, found by a ray from there in the unit `direction`.
    /// Whether the ray meets the lamp's shining side, no farther than `t_max`; fills `hit`.
    bool meet(const glm::dvec3& position, const glm::dvec3& direction, LampHit& hit,
              double t_max = std::numeric_limits<double>::infinity()) const;

    /// About the irradiance (luminance of it, W/m2) that it brings, where nothing is in between, to
    /// a surface at `position` that faces in the direction of the unit vector `normal`; or faces
    /// the lamp, where `normal` is 0. It is 0 only where the lamp does bring none.
    double brightness(const glm::dvec3& position, const glm::dvec3& normal) const;

private:
    friend struct LightParts;  ///< hands what was prepared to devices

    double nearer(double distance, double sine) const;
    LightSample sample_disk_lamp(const glm::dvec3& position, const glm::dvec2& random) const;
    LightSample sample_sun(const glm::dvec2& random) const;
    LightSample sample_area(const glm::dvec3& position, const glm::dvec2& random) const;
    bool meet_disk_lamp(const glm::dvec3& position, const glm::dvec3& direction, LampHit& hit,
                        double t_max) const;
    bool meet_sun(const glm::dvec3& direction, LampHit& hit, double t_max) const;
    bool meet_area(const glm::dvec3& position, const glm::dvec3& direction, LampHit& hit,
                   double t_max) const;
    double brightness_of_disk(const glm::dvec3& to_centre, const glm::dvec3& normal) const;
    double brightness_of_area(const glm::dvec3& to_centre, const glm::dvec3& normal) const;
    double spot_mask(const glm::dvec3& away) const;
    bool is_drawn_by_solid_angle(double squared_distance) const;

    LightKind kind_;
    bool ellipse_, right_angled_;
    glm::dvec3 centre_;
    double reach_ = 0.0;          ///< size of the coordinates of its farthest point
    glm::dvec3 back_;             ///< unit vector against the direction in which the lamp shines
    glm::dvec3 edge_x_, edge_y_;  ///< of an area
    glm::dvec3 unit_x_{0.0}, unit_y_{0.0};  ///< along them
    glm::dvec2 size_{0.0};                  ///< their lengths
    /// Radiant intensity (point, spot), irradiance (sun) or radiance (area).
    glm::dvec3 strength_;
    /// Radius (point, spot), 1 - cosine of the angular radius (sun) or surface area (area).
    double extent_;
    double luminance_;                 ///< of strength_
    double spot_edge_, spot_blended_;  ///< cosine at the cone's edge, and its part that fades out
};

}  // namespace bvhlab
