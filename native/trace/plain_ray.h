// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>

#include "trace/intersect.h"

namespace bvhlab {

/// A ray for ordinary slabs (Kay, Kajiya 1986): distances (plane - origin) * (1 / direction) as
/// they are rounded, the direction as given. A component 0 has an infinite inverse, and a plane
/// through the origin then the distance 0 * infinity = NaN (see enter_boxes).
struct PlainRay {
    glm::vec3 origin, direction;
    float t_min, t_max;
    glm::vec3 inverse;
    int near_plane[3], far_plane[3];
    static constexpr double unscale = 1.0;

    PlainRay(const Ray& ray, const Box&)
        : origin(ray.origin), direction(ray.direction), t_min(ray.t_min), t_max(ray.t_max) {
        for (int axis = 0; axis < 3; ++axis) {
            const bool negative = std::signbit(direction[axis]);
            inverse[axis] = 1.0F / direction[axis];
            near_plane[axis] = 2 * axis + (negative ? 1 : 0);
            far_plane[axis] = 2 * axis + (negative ? 0 : 1);
        }
    }

    Slabs slabs() const { return {origin, origin, inverse, inverse}; }
};

/// The watertight test's ray, with ordinary slabs for the nodes.
struct PlainPreparedRay : PreparedRay {
    glm::vec3 inverse;

    PlainPreparedRay(const Ray& ray, const Box& bounds)
        : PreparedRay(ray, bounds), inverse(1.0F / direction) {}

    Slabs slabs() const { return {origin, origin, inverse, inverse}; }
};

/// A ray whose coordinates can be read from any axis on, by Baldwin and Weber's test.
template <class BoxTestRay>
struct CyclicRay : BoxTestRay {
    /// [i][axis]: coordinate axis + i, in vectors of four for lookup.
    alignas(16) float cyclic_origin[3][4];
    alignas(16) float cyclic_direction[3][4];

    CyclicRay(const Ray& ray, const Box& bounds) : BoxTestRay(ray, bounds) {
        for (int i = 0; i < 3; ++i) {
            for (int axis = 0; axis < 4; ++axis) {
                cyclic_origin[i][axis] = this->origin[(axis + i) % 3];
                cyclic_direction[i][axis] = this->direction[(axis + i) % 3];
            }
        }
    }
};

}  // namespace bvhlab
