// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "build/reference_set.h"
#include "scene/mesh.h"

/// Cutting triangles at axis-aligned planes, without a gap that a hit could fall through.
///
/// The parts of a triangle T are the sets S that repeated cuts leave: at a plane, S becomes S with
/// x <= p and S with x >= p (both closed, so a point on the plane is in both). A reference's box U
/// is kept *unpadded* and obeys
///
///     every point of S lies within e of U on every axis,   e = 2^-23 * max |coordinate of T on
///     that axis|.
///
/// It holds at first, with U = box of T. A cut gives S' = S in half-space H the box
/// U' = U meet bounds(T in H) meet H. Points of S' are within e of U, within e of bounds(T in H),
/// because those bounds come straight from the original corners and edges (a float corner is exact;
/// an edge's crossing is computed in double with an error below 2^-50 * max, then rounded to float
/// with one of at most 2^-24 * max), and exactly in H, as p is a float. A point that is within e of
/// several intervals is within e of their meet. So e does not grow with the number of cuts, and
/// nothing need be clipped anew.
///
/// In the end `padded_box` widens U by e + 2^-22 * max, rounded outward. A hit point computed in
/// double lies within far less than 2^-22 * max of a point of T, hence in the padded box of the
/// part which that point belongs to; and two parts that meet at a plane overlap by their pads on
/// both sides of it.
namespace bvhlab {

/// Whether spatial splits may cut the triangle: not where it has no area and no ray can hit it.
bool is_splittable(const Triangle& triangle);

struct CutBoxes {
    Box left, right;  ///< empty where the part does not reach that side
};

/// Unpadded boxes of the two parts of a reference to `triangle`.
CutBoxes cut(const Reference& reference, const Triangle& triangle, int axis, float plane);

/// The box for a leaf that holds the part of a triangle with unpadded box `part`: never larger than
/// `whole`, the box of the triangle.
Box padded_box(const Box& part, const Box& whole);

}  // namespace bvhlab
