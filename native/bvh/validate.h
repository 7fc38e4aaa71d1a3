// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "bvh/binary_bvh.h"
#include "bvh/wide_bvh.h"

namespace bvhlab {

/// Checks every invariant of a finished tree: each node but the root is the child of exactly one
/// node, each triangle is referenced, boxes are free of NaN and contain what is below them, leaf
/// block ranges are disjoint and complete, and counts and depth are those stored.
///
/// A compressed tree's masks and metadata must be those of what is stored, unused slots must be
/// marked as such, and the boxes are taken as they decode; its nodes need not contain the boxes
/// below them, but the common part of all boxes down to a leaf counts as the leaf's.
///
/// Boxes of split references need not contain their triangle: then every corner of the triangle
/// must lie in one of its references' boxes. Throws std::logic_error with the first broken
/// invariant.
void validate(const Bvh& bvh);

/// The same for a builder's result. Throws std::logic_error.
void validate(const BinaryBvh& bvh, const Mesh& mesh);

}  // namespace bvhlab
