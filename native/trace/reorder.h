// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "base/array.h"
#include "base/token.h"
#include "scene/box.h"
#include "trace/ray.h"

namespace bvhlab {

/// What decides the order in which rays are traced: the 32-bit keys that Meister et al. 2020 ("On
/// Ray Reordering Techniques for Faster GPU Ray Tracing") compare. Points are cells of the cube
/// whose side is the longest of the scene's box, at its lower corner; what lies outside is clamped.
/// A level is one bit of each coordinate, x first, from the highest.
enum class Reorder {
    off,         ///< as the rays come
    aila,        ///< 3 levels of the origin, then origin and direction in turn: the paper's choice
    origin,      ///< 10 2/3 levels of the origin
    octahedron,  ///< 4 levels of the origin, then it and the direction, unfolded to 2D, in turn
    two_point,   ///< levels of the origin and of where the ray may end in turn
};

inline constexpr std::array<const char*, 5> reorder_names{"off", "aila", "origin", "octahedron",
                                                          "two_point"};

/// The order of that name. Throws std::invalid_argument listing the names.
Reorder reorder_named(std::string_view name);

/// Computes sort keys. Nothing in here depends on the scene's scale or place.
class RayKeys {
public:
    explicit RayKeys(const Box& scene);

    /// Key of one ray; `order` is not `off`, the direction not zero.
    std::uint32_t operator()(Reorder order, const Ray& ray) const;

    /// Share of the cube's side that a ray is taken to go on unless it ends before: what the
    /// authors' released framework uses for path rays.
    static constexpr double ray_length = 0.25;

private:
    glm::dvec3 lower_;
    double scale_;  ///< 1 / side of the cube; 0 where the box is a point
};

/// The order in which to trace rays, and what finding it took.
struct RayOrder {
    Array<std::uint32_t> order;
    double key_seconds, sort_seconds;
};

/// Sorts rays by their keys. Rays are not moved; equal keys keep their order.
RayOrder order_rays(Reorder order, const RayBatch& rays, const Box& scene, const Token& token);

}  // namespace bvhlab
