// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "base/parallel.h"
#include "base/token.h"
#include "build/build_log.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"

namespace bvhlab {

/// Leaves of the largest treelet.
inline constexpr unsigned max_treelet_size = 30;

/// The top of a subtree: `size` treelet leaves, which may be interior nodes of the tree, under
/// `size` - 1 interior nodes (Karras and Aila 2013).
struct Treelet {
    unsigned size;
    std::array<std::uint32_t, max_treelet_size> leaves;
    std::array<std::uint32_t, max_treelet_size - 1> interior;  ///< the root first
    double area;  ///< half areas of the interior nodes below the root
};

/// Makes a node of two of a treelet's parts: parts 0 .. size - 1 are its leaves, part size + i is
/// what the i-th merge made.
struct Merge {
    std::uint8_t left, right;
};

/// Another tree over a treelet's leaves: `size` - 1 merges, the last of which makes the root.
struct Topology {
    std::array<Merge, max_treelet_size - 1> merges;
    std::array<Box, max_treelet_size - 1> boxes;  ///< by merge
    double area;  ///< half areas of the interior nodes below the root
};

/// Opens the treelet leaf of largest area until there are `size` (Karras and Aila 2013). `root`
/// must have at least `size` references, `size` be at least 2.
Treelet form_treelet(const BinaryBvh& bvh, std::uint32_t root, unsigned size);

/// Fills in boxes and area from the merges.
void measure(const BinaryBvh& bvh, const Treelet& treelet, Topology& topology);

/// Number of references below each interior node. Throws Cancelled.
Array<std::uint32_t> reference_counts(const BinaryBvh& bvh, const Token& token);

/// Gives the treelet's interior nodes a measured topology. Only nodes below its root and the root's
/// links change.
void replace(BinaryBvh& bvh, Array<std::uint32_t>& counts, const Treelet& treelet,
             const Topology& topology);

/// When treelet restructuring ends.
struct RestructuringLimits {
    std::uint32_t treelet_size;
    std::uint32_t iterations;
    double max_seconds;  ///< since the watch was started; 0 = no limit
};

/// Passes over the tree in which `restructure(root)` is called for every node of at least gamma
/// references, each after all below it, many at a time. gamma is the treelet size, doubled each
/// pass; once it exceeds the number of references the tree has converged (Karras and Aila 2013;
/// Domingues and Pedrini 2015).
///
/// `restructure` may change what is below the root and the root's links, keeps `counts` true and
/// returns by how much it reduced the half areas of interior nodes. Trees are the same for any
/// thread count, and valid when a limit ends the passes. Throws Cancelled.
void restructure_treelets(BinaryBvh& bvh, const Array<std::uint32_t>& counts,
                          const RestructuringLimits& limits, const CostModel& model,
                          const Stopwatch& watch, Token& token, BuildLog& log,
                          const std::function<double(std::uint32_t root)>& restructure);

}  // namespace bvhlab
