// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "base/array.h"

namespace bvhlab {

/// One ray; points on it are origin + t * direction for t in [t_min, t_max], 0 <= t_min. The
/// direction need not be of unit length; t is in its units.
struct Ray {
    glm::vec3 origin;
    float t_min;
    glm::vec3 direction;
    float t_max;
};

/// Rays as the caller holds them. `t_min` and `t_max` have one entry for all rays or one each.
struct RayBatch {
    std::span<const glm::vec3> origins;
    std::span<const glm::vec3> directions;
    std::span<const float> t_min;
    std::span<const float> t_max;

    std::size_t size() const { return origins.size(); }
    Ray operator[](std::size_t i) const {
        return {origins[i], t_min[t_min.size() == 1 ? 0 : i], directions[i],
                t_max[t_max.size() == 1 ? 0 : i]};
    }
};

/// What one ray met. A miss has t = infinity, u = v = 0 and triangle = no_triangle. The hit point
/// is (1 - u - v) a + u b + v c.
template <class Real>
struct HitOf {
    Real t, u, v;
    std::uint32_t triangle;
};
using Hit = HitOf<float>;

/// Answers for a batch, by ray. Arrays that were not asked for are empty.
template <class Real>
struct HitsOf {
    Array<Real> t, u, v;                  ///< closest hit only
    Array<std::uint32_t> triangle;        ///< closest hit only
    Array<std::uint8_t> occluded;         ///< always: 1 where something was hit
    Array<std::uint32_t> node_visits;     ///< interior nodes visited, when counted
    Array<std::uint32_t> box_tests;       ///< boxes of those nodes' children, missing ones not
    Array<std::uint32_t> triangle_tests;  ///< triangles tested, unused lanes not counted

    double key_seconds = 0.0;  ///< computing sort keys
    double sort_seconds = 0.0;
    double traverse_seconds = 0.0;
    double prepare_seconds = 0.0;    ///< making transforms of the tree's triangles; in no sum
    std::size_t prepared_bytes = 0;  ///< of the transforms that the triangle test reads
    double seconds() const { return key_seconds + sort_seconds + traverse_seconds; }
};
using Hits = HitsOf<float>;

}  // namespace bvhlab
