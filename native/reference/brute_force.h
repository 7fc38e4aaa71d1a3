// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/token.h"
#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

/// Tests every ray against every triangle: the judge of every other way to trace.
///
/// Which triangle is hit is what real arithmetic on the given floats says, without any rounding
/// (exact_hit.h): two-sided, edges and corners inside, t_min <= t <= t_max, the lower index where t
/// is equal. t, u and v are then rounded to double. It shares no formula with the traversal: that
/// shears the triangle into ray space and decides in double.
///
/// Rays must be finite. `threads` 0 means all. Throws Cancelled.
HitsOf<double> brute_force(const Mesh& mesh, const RayBatch& rays, bool any_hit, int threads,
                           Token& token);

}  // namespace bvhlab
