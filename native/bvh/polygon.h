// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "scene/box.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Corners of a plane convex polygon in order, in double: squares of float coordinates neither
/// overflow nor vanish.
using Polygon = std::vector<glm::dvec3>;

inline void set_polygon(Polygon& polygon, const Triangle& triangle) {
    polygon.assign({triangle.a, triangle.b, triangle.c});
}

/// Twice the area.
inline double doubled_area(const Polygon& polygon) {
    glm::dvec3 sum(0.0);
    for (std::size_t i = 2; i < polygon.size(); ++i)
        sum += glm::cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]);
    return glm::length(sum);
}

struct Extent {
    glm::dvec3 lower, upper;

    bool meets(const Box& box) const {
        return lower.x <= double(box.upper.x) && upper.x >= double(box.lower.x) &&
               lower.y <= double(box.upper.y) && upper.y >= double(box.lower.y) &&
               lower.z <= double(box.upper.z) && upper.z >= double(box.lower.z);
    }
    bool is_in(const Box& box) const {
        return lower.x >= double(box.lower.x) && upper.x <= double(box.upper.x) &&
               lower.y >= double(box.lower.y) && upper.y <= double(box.upper.y) &&
               lower.z >= double(box.lower.z) && upper.z <= double(box.upper.z);
    }
};

inline Extent extent(const Polygon& polygon) {
    Extent extent{polygon[0], polygon[0]};
    for (const glm::dvec3& corner : polygon) {
        extent.lower = glm::min(extent.lower, corner);
        extent.upper = glm::max(extent.upper, corner);
    }
    return extent;
}

/// Cuts off what lies strictly on one side of an axis-aligned plane (Sutherland & Hodgman 1974):
/// beyond it for `side` = 1, before it for `side` = -1. New corners lie exactly on the plane; a
/// polygon that only touches the plane keeps fewer than three corners.
inline void cut_polygon(const Polygon& polygon, int axis, double plane, double side,
                        Polygon& kept) {
    kept.clear();
    glm::dvec3 last = polygon.back();
    double last_beyond = side * (last[axis] - plane);
    for (const glm::dvec3& corner : polygon) {
        const double beyond = side * (corner[axis] - plane);
        if ((beyond < 0.0 && last_beyond > 0.0) || (beyond > 0.0 && last_beyond < 0.0)) {
            glm::dvec3 crossing = last + (corner - last) * (last_beyond / (last_beyond - beyond));
            crossing[axis] = plane;
            kept.push_back(crossing);
        }
        if (beyond <= 0.0) kept.push_back(corner);
        last = corner;
        last_beyond = beyond;
    }
}

/// Clips `polygon`, whose extent is given, to a closed box. `spare` is working memory. False where
/// less than a polygon is left.
inline bool clip_polygon(Polygon& polygon, const Extent& reach, const Box& box, Polygon& spare) {
    for (int axis = 0; axis < 3; ++axis) {
        const double planes[2] = {double(box.lower[axis]), double(box.upper[axis])};
        if (reach.lower[axis] < planes[0]) {
            cut_polygon(polygon, axis, planes[0], -1.0, spare);
            polygon.swap(spare);
            if (polygon.size() < 3) return false;
        }
        if (reach.upper[axis] > planes[1]) {
            cut_polygon(polygon, axis, planes[1], 1.0, spare);
            polygon.swap(spare);
            if (polygon.size() < 3) return false;
        }
    }
    return true;
}

}  // namespace bvhlab
