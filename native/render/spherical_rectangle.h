// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <numbers>

namespace bvhlab {

/// A rectangle as seen from the origin, for drawing its points uniformly by solid angle, so that a
/// surface close to a large lamp is not noisier than one far away. Ureña, Fajardo, King 2013, "An
/// Area-Preserving Parametrization for Spherical Rectangles", sections 3 and 4.
class SphericalRectangle {
public:
    /// `corner` from the origin, and the two edges, at right angles and of some length. The origin
    /// must not lie in the rectangle's plane.
    SphericalRectangle(const glm::dvec3& corner, const glm::dvec3& edge_x, const glm::dvec3& edge_y)
        : x_(glm::normalize(edge_x)), y_(glm::normalize(edge_y)), z_(glm::cross(x_, y_)) {
        if (glm::dot(corner, z_) > 0.0) z_ = -z_;
        low_ = {glm::dot(corner, x_), glm::dot(corner, y_)};
        high_ = low_ + glm::dvec2(glm::length(edge_x), glm::length(edge_y));
        depth_ = glm::dot(corner, z_);

        // Normals of the planes through the origin and each edge, and the angles between
        // neighbours.
        const glm::dvec3 bottom = glm::normalize(glm::dvec3(0.0, depth_, -low_.y));
        const glm::dvec3 right = glm::normalize(glm::dvec3(-depth_, 0.0, high_.x));
        const glm::dvec3 top = glm::normalize(glm::dvec3(0.0, -depth_, high_.y));
        const glm::dvec3 left = glm::normalize(glm::dvec3(depth_, 0.0, -low_.x));
        const auto angle = [](const glm::dvec3& a, const glm::dvec3& b) {
            return std::acos(std::clamp(-glm::dot(a, b), -1.0, 1.0));
        };
        bottom_z_ = bottom.z;
        top_z_ = top.z;
        first_angle_ = 2.0 * std::numbers::pi - angle(top, left) - angle(left, bottom);
        solid_angle_ = angle(bottom, right) + angle(right, top) - first_angle_;
    }

    /// In steradians; loses digits below about 1e-6.
    double solid_angle() const { return solid_angle_; }

    /// A point of the rectangle, from the origin.
    glm::dvec3 sample(const glm::dvec2& random) const {
        // The column left of which the share random.x of the solid angle lies.
        const double angle = random.x * solid_angle_ + first_angle_;
        const double f = (std::cos(angle) * bottom_z_ - top_z_) / std::sin(angle);
        const double cosine = std::clamp(std::copysign(1.0 / length(f, bottom_z_), f), -1.0, 1.0);
        const double x =
            std::clamp(-cosine * depth_ / std::sqrt(1.0 - cosine * cosine), low_.x, high_.x);

        // The place in that column; its solid angle is linear in the sine of the elevation.
        const double distance = length(x, depth_);
        const double lowest = low_.y / length(distance, low_.y);
        const double highest = high_.y / length(distance, high_.y);
        const double sine = lowest + random.y * (highest - lowest);
        const double y =
            std::clamp(sine * distance / std::sqrt(1.0 - sine * sine), low_.y, high_.y);
        return x * x_ + y * y_ + depth_ * z_;
    }

private:
    static double length(double a, double b) { return std::sqrt(a * a + b * b); }

    glm::dvec3 x_, y_, z_;
    glm::dvec2 low_, high_;
    double depth_;
    double bottom_z_, top_z_;
    double first_angle_, solid_angle_;
};

}  // namespace bvhlab
