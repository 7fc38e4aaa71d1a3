// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/clip.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace bvhlab {
namespace {

/// The point of edge a-b on the plane, where the plane lies strictly between a and b on its axis.
glm::vec3 crossing(const glm::dvec3& a, const glm::dvec3& b, int axis, float plane) {
    const double t = (double(plane) - a[axis]) / (b[axis] - a[axis]);
    glm::vec3 point(a + t * (b - a));
    point[axis] = plane;
    return point;
}

float round_down(double value) {
    const float nearest = float(value);
    return double(nearest) <= value
               ? nearest
               : std::nextafter(nearest, -std::numeric_limits<float>::infinity());
}

float round_up(double value) {
    return -round_down(-value);
}

}  // namespace

bool is_splittable(const Triangle& triangle) {
    const glm::dvec3 a(triangle.a), b(triangle.b), c(triangle.c);
    return glm::cross(b - a, c - a) != glm::dvec3(0.0);
}

CutBoxes cut(const Reference& reference, const Triangle& triangle, int axis, float plane) {
    const glm::vec3 corners[3] = {triangle.a, triangle.b, triangle.c};
    CutBoxes boxes{Box::empty(), Box::empty()};
    for (int i = 0; i < 3; ++i) {
        const glm::vec3& from = corners[i];
        const glm::vec3& to = corners[(i + 1) % 3];
        if (from[axis] <= plane) boxes.left.grow(from);
        if (from[axis] >= plane) boxes.right.grow(from);
        if ((from[axis] < plane && to[axis] > plane) || (from[axis] > plane && to[axis] < plane)) {
            const glm::vec3 point = crossing(from, to, axis, plane);
            boxes.left.grow(point);
            boxes.right.grow(point);
        }
    }
    boxes.left = intersect(boxes.left, reference.box);
    boxes.right = intersect(boxes.right, reference.box);
    return boxes;
}

Box padded_box(const Box& part, const Box& whole) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        const double size =
            std::max(std::abs(double(whole.lower[axis])), std::abs(double(whole.upper[axis])));
        const double pad = std::max(0x1.8p-22 * size, double(std::numeric_limits<float>::min()));
        box.lower[axis] = std::max(whole.lower[axis], round_down(double(part.lower[axis]) - pad));
        box.upper[axis] = std::min(whole.upper[axis], round_up(double(part.upper[axis]) + pad));
    }
    return box;
}

}  // namespace bvhlab
