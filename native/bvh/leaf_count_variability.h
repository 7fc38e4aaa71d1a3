// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "base/token.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// How many leaf boxes a random line through the scene meets.
struct LeafCounts {
    double mean = 0.0;       ///< over the lines drawn; expected: sum of leaf areas / scene area
    double deviation = 0.0;  ///< standard deviation: leaf-count variability
    double error = 0.0;      ///< standard error of `deviation`
};

/// Leaf-count variability (Aila, Karras, Laine 2013): the standard deviation of the number of leaf
/// boxes that a ray meets, here of `lines` full lines without early end.
///
/// The lines are uniform in the only measure that motions leave as it is (isotropic uniform random
/// lines), the one behind the surface area heuristic: a uniform point on the surface of the
/// scene's box, and a direction into it with density cos(theta) / pi. In that measure the lines
/// of one direction that meet a convex body are as many as its shadow is large, and the shadow is a
/// quarter of the surface on average (Cauchy), so a line through the scene meets a box in it with
/// probability area(box) / area(scene). Two independent points on the surface would not do: that
/// adds a factor cos cos / distance^2, which is constant on a sphere but not on a box.
///
/// Drawn by a counter, so the same for any thread count. All 0 where the scene's box has no area;
/// flat boxes have two sides. `lines` is at least 2. Throws Cancelled.
LeafCounts leaf_count_variability(const Bvh& bvh, std::size_t lines, Token& token);

}  // namespace bvhlab
