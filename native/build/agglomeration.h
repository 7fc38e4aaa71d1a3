// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "build/treelet.h"

namespace bvhlab {

/// Boxes as one row per coordinate, for SIMD.
struct BoxRows {
    static constexpr int capacity = 32;  ///< max_treelet_size, rounded up to whole vectors

    alignas(64) float lower[3][capacity];
    alignas(64) float upper[3][capacity];
};

/// Bottom-up clustering of `count` boxes (2 .. max_treelet_size): merges the pair whose union has
/// the least area until one is left. Fills `count` - 1 merges, each after those that made its
/// parts; overwrites the boxes. Coordinates must be small enough for areas not to overflow. The
/// same on all processors: SIMD only changes the speed.
void agglomerate(BoxRows& boxes, int count, Merge* merges);

}  // namespace bvhlab
