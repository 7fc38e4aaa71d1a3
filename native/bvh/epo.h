// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/token.h"
#include "bvh/cost.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// End-point overlap (Aila, Karras, Laine 2013, "On Quality Metrics of Bounding Volume
/// Hierarchies"): the work that a ray ending on a surface does in nodes that hold its end point
/// though the surface is not in them, on average over all surfaces,
///
///     EPO = sum over nodes n of C_n area((S \ Q(n)) meet box(n)) / area(S),
///
/// with S all surfaces, Q(n) the triangles that leaves below n refer to, C_n as in Eq. 2 and 3.
///
/// Areas are exact up to the rounding of double: each triangle is clipped to each box that it
/// reaches into. Boxes are closed, as they are for rays, so a triangle in the common face of two
/// boxes lies in both. Decoded boxes of compressed nodes stick out of their parents' by the
/// coarseness of the grid: box(n) is then what rays can reach, its common part with the boxes above
/// it. A triangle is in Q(n) as a whole as soon as one leaf below n refers to it:
/// that a spatial split put other parts elsewhere does not count as overlap. Triangles that lie in
/// one place count each. 0 where the scene has no area.
///
/// The time grows with the number of pairs of triangle and node that overlap, and is spread over
/// the threads of the caller's arena; the sum does not depend on how many they are. Throws
/// Cancelled.
double end_point_overlap(const Bvh& bvh, const CostModel& model, Token& token);

}  // namespace bvhlab
