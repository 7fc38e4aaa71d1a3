// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>

#include "bvh/compressed_bvh.h"

namespace bvhlab {

/// Sets origin, exponents and planes of a compressed node so that each decoded box contains the box
/// given for its slot. `boxes` and `slots` have 1 to 8 entries; planes of other slots are set so
/// that they decode to an empty box, or to one plane where the node has no extent.
///
/// The steps are the least powers of two 2^e with which 255 steps span the node (Ylitie et al.
/// 2017, section 3.1), so at most 1/127.5 of the node's extent. Bounds:
///
/// - A plane decodes to round(origin + q 2^e) (CompressedNode::plane). The exact sum at q =
///   floor((lower - origin) / 2^e) is not above `lower`, which is a float, and rounding is
///   monotone: the decoded plane is not above it either. The same for q = ceil(...) and `upper`.
///   Here both quotients are taken in double. The difference of two floats errs by at most 2^-53 of
///   itself, which is below 2^-44 steps, and division by a power of two does not err: so q is off
///   by at most one, and checking the decoded plane against the true one puts it right.
/// - So a decoded plane is less than one step and one rounding (half an ulp of the plane) outside
///   of the true one.
/// - e is at least -126. Nodes smaller than 255 * 2^-126 = 3e-36 have steps of 2^-126: coarser than
///   needed, but no multiple of a step is denormal.
/// - Up to extents of 255 * 2^120 = 3.4e38, far beyond those of meshes (make_mesh), no multiple of
///   a step overflows. Beyond, multiples above 127 do, and the plane decodes to +infinity: upper
///   planes alone, for lower ones are checked, and a box that reaches too far is never missed.
void quantise(std::span<const Box> boxes, std::span<const std::uint8_t> slots,
              CompressedNode& node);

}  // namespace bvhlab
