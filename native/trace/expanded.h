// SPDX-License-Identifier: GPL-3.0-or-later
// Exact decisions by expansions (base/exact_sum.h), which do for all finite floats.
#pragma once

#include "trace/intersect.h"

namespace bvhlab {

/// The edge function of the edge between two corners: det(d, from - origin, to - origin) / d[kz],
/// d = given_direction.
double expanded_edge_function(const PreparedRay& ray, const float (&from)[3], const float (&to)[3]);

/// exact_plane_crossing().
bool expanded_plane_crossing(const PreparedRay& ray, const float (&corners)[3][3],
                             PlaneCrossing& crossing);

}  // namespace bvhlab
