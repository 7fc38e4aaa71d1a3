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
        : SphericalRectangle(corner, glm::normalize(edge_x), glm::normalize(edge_y),
                             {glm::length(edge_x), glm::length(edge_y)}) {}

    /// With edges as unit vectors and their lengths.
    SphericalRectangle(const glm::dvec3& corner, const glm::dvec3& along_x,
                       const glm::dvec3& along_y, const glm::dvec2& size)
        : x_(along_x), y_(along_y), z_(glm::cross(x_, y_)) {
        if (glm::dot(corner, z_) > 0.0) z_ = -z_;
        low_ = {glm::dot(corner, x_), glm::dot(corner, y_)};
        high_ = low_ + size;
        depth_ = glm::dot(corner, z_);

        // The angle between the planes through the origin and two neighbouring edges, as a complex
        // number that has it as its argument: its sine is in proportion to the distance of the
        // corner where they meet. Products of these numbers add up the angles.
        const double scale = 1.0 / std::abs(depth_);
        const glm::dvec2 low = scale * low_, high = scale * high_;
        using Complex = glm::dvec2;
        const auto angle = [](double x, double y, double sign) {
            return Complex(sign * x * y, std::sqrt(1.0 + x * x + y * y));
        };
        const auto product = [](const Complex& a, const Complex& b) {
            return Complex(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
        };
        const Complex right = product(angle(high.x, low.y, 1.0), angle(high.x, high.y, -1.0));
        const Complex left = product(angle(low.x, high.y, 1.0), angle(low.x, low.y, -1.0));
        const auto argument = [](const Complex& a) {
            const double turn = std::atan2(a.y, a.x);
            return turn < 0.0 ? turn + 2.0 * std::numbers::pi : turn;
        };
        solid_angle_ = argument(right) + argument(left) - 2.0 * std::numbers::pi;
        first_ = Complex(left.x, -left.y) / glm::length(left);
        bottom_z_ = -low.y / length(1.0, low.y);
        top_z_ = high.y / length(1.0, high.y);
    }

    /// In steradians, with an error of about 1e-15: loses digits below about 1e-9.
    double solid_angle() const { return solid_angle_; }

    /// A point of the rectangle, from the origin.
    glm::dvec3 sample(const glm::dvec2& random) const {
        // The column left of which the share random.x of the solid angle lies.
        const double turn = random.x * solid_angle_;
        const double cos_turn = std::cos(turn), sin_turn = std::sin(turn);
        const double cos_angle = first_.x * cos_turn - first_.y * sin_turn;
        const double sin_angle = first_.x * sin_turn + first_.y * cos_turn;
        const double f = (cos_angle * bottom_z_ - top_z_) / sin_angle;
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
    glm::dvec2 first_;  ///< cosine and sine of the angle at which columns start
    double solid_angle_;
};

}  // namespace bvhlab
