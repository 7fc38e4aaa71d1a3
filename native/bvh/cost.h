// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

namespace bvhlab {

struct BinaryBvh;
struct Bvh;

/// Constants of the surface area heuristic (paper section 2.1 and 4: c_T = 3, c_I = 2). One struct
/// serves builders, collapse and statistics, so that all of them minimise and report the same cost.
struct CostModel {
    double traversal = 3.0;     ///< c_T, expected cost of visiting an interior node
    double intersection = 2.0;  ///< c_I, expected cost of one triangle test
};

/// Triangle tests charged for a leaf of `size` references: `size` in a binary tree (Eq. 2), rounded
/// up to a multiple of the branching factor k in a wide one (Eq. 3).
inline std::size_t charged_tests(std::size_t size, unsigned branching) {
    return branching == 2 ? size : (size + branching - 1) / branching * branching;
}

/// Eq. 2 (k = 2) or Eq. 3 (k = 4, 8) of the whole tree, the root included, summed in double. In
/// compressed nodes boxes count as they decode, and a leaf is charged its references as they are
/// (Ylitie et al. 2017): no lane of it is unused.
double cost(const Bvh& bvh, const CostModel& model);

/// Eq. 2 of a tree with one reference per leaf, summed in double. The same for any thread count.
double cost(const BinaryBvh& bvh, const CostModel& model);

}  // namespace bvhlab
