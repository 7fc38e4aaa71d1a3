// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

namespace bvhlab {

/// Axis-aligned box with both faces included. The empty box has lower > upper on every axis.
struct Box {
    glm::vec3 lower;
    glm::vec3 upper;

    static Box empty() {
        constexpr float infinity = std::numeric_limits<float>::infinity();
        return {glm::vec3(infinity), glm::vec3(-infinity)};
    }

    bool is_empty() const { return lower.x > upper.x || lower.y > upper.y || lower.z > upper.z; }

    void grow(const glm::vec3& point) {
        lower = glm::min(lower, point);
        upper = glm::max(upper, point);
    }

    void grow(const Box& box) {
        lower = glm::min(lower, box.lower);
        upper = glm::max(upper, box.upper);
    }

    bool contains(const Box& box) const {
        return glm::all(glm::lessThanEqual(lower, box.lower)) &&
               glm::all(glm::greaterThanEqual(upper, box.upper));
    }

    /// Half the surface area, 0 for an empty box. In double: the squares of float extents overflow
    /// float beyond 1e19 and vanish below 1e-19, and scenes of any scale must build.
    double half_area() const {
        if (is_empty()) return 0.0;
        const double x = double(upper.x) - double(lower.x);
        const double y = double(upper.y) - double(lower.y);
        const double z = double(upper.z) - double(lower.z);
        return x * y + y * z + z * x;
    }

    /// Twice the centre, exact enough to order by and free of overflow for |coordinate| < 1e38.
    glm::vec3 doubled_centre() const { return lower + upper; }
};

inline Box unite(Box a, const Box& b) {
    a.grow(b);
    return a;
}

/// The common part of two boxes; empty where they are apart.
inline Box intersect(const Box& a, const Box& b) {
    return {glm::max(a.lower, b.lower), glm::min(a.upper, b.upper)};
}

}  // namespace bvhlab
