// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "scene/box.h"

namespace bvhlab {

/// Which of a compressed node's eight slots each of its children takes (Ylitie et al. 2017, section
/// 3.2), so that visiting slots in an order that depends on the signs of a ray's direction only
/// comes close to visiting children by distance.
///
/// Slot s is visited first by rays whose direction d_s has a negative x, y, z where bit 2, 1, 0 of
/// s is set. The child in it should lie at the beginning along d_s: the slots taken minimise the
/// sum over children of (centre of child - centre of node) . d_s. The paper's auction finds that
/// minimum up to a bound; here it is exact up to the rounding of double. Where several choices are
/// equal, always the same one is taken.
///
/// `boxes` has 1 to 8 boxes. Returns the slot of each; the rest of the array is 0.
std::array<std::uint8_t, 8> octant_slots(std::span<const Box> boxes);

}  // namespace bvhlab
