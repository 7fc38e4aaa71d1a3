// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/array.h"
#include "scene/box.h"

namespace bvhlab {

/// Boxes of a row of clusters, one array per face, in units in which areas neither overflow nor,
/// where it matters, vanish in float (the unit scale of ploc.cpp).
struct ClusterBoxes {
    static constexpr std::size_t padding = 16;  ///< floats that SIMD may read past the last box

    std::array<Array<float>, 3> lower, upper;  ///< by axis

    static ClusterBoxes with_room_for(std::size_t count);

    Box operator[](std::size_t i) const {
        return {{lower[0][i], lower[1][i], lower[2][i]}, {upper[0][i], upper[1][i], upper[2][i]}};
    }

    void set(std::size_t i, const Box& box) {
        for (int axis = 0; axis < 3; ++axis) {
            lower[axis][i] = box.lower[axis];
            upper[axis][i] = box.upper[axis];
        }
    }
};

/// The nearest neighbour search of Meister and Bittner 2018a: for each cluster i in [begin, end) of
/// the first `count` in `boxes`, at least 2, writes to nearest[i] the cluster j != i within
/// `radius` places whose union with i has the least surface area, the lowest j of equals.
///
/// Areas are computed in float, by the same operations on every instruction set, and are the same
/// for (i, j) and (j, i).
void find_nearest(const ClusterBoxes& boxes, std::uint32_t count, std::uint32_t radius,
                  std::uint32_t begin, std::uint32_t end, std::uint32_t* nearest);

}  // namespace bvhlab
