// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "bvh/wide_bvh.h"
#include "opencl/commands.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// Calls `launch(start, count)` for parts of `items` work-items, so that no launch takes long.
template <class Number, class Launch>
void in_parts(Number items, const Launch& launch) {
    constexpr Number part = Number(1) << 22U;
    for (Number start = 0; start < items;) {
        const Number count = std::min<Number>(part, items - start);
        launch(start, count);
        start += count;
    }
}

/// A binary tree's nodes, planned by collapse.cl for wide nodes of `branching` children.
struct Plans {
    unsigned branching;
    bool compressed;
    Buffer<std::uint64_t> nodes;    ///< by interior node: packed plan, number of references
    Buffer<std::uint32_t> parents;  ///< by node
    Buffer<std::uint32_t> work;     ///< `branching` for each interior node: costs at first, then
                                    ///< children of wide nodes

    Plans(Commands& commands, const DeviceBinary& binary, unsigned branching, bool compressed);

    /// References of a block (bvh/wide_bvh.h); compressed leaves have no blocks.
    unsigned lanes() const { return compressed ? 1 : std::max(branching, 4U); }

    /// Options of the programs that go with this tree.
    std::string options() const;
};

/// The wide nodes of a planned tree, level by level, as bvh/level_order.h finds them.
struct LevelOrder {
    Buffer<std::uint32_t> opened;  ///< children of each, `branching` to a node (level_order.cl)
    Buffer<std::uint32_t> first_child;  ///< first of its interior children
    Buffer<std::uint32_t> blocks;       ///< first block of its leaves
    Buffer<std::uint32_t> lanes;        ///< references of all blocks (level_order.cl)
    std::uint32_t node_count = 0, block_count = 0;
};

/// Reads the plans top-down and lists the references of leaves; sets the counts of `bvh`. Takes
/// `plans.work` over.
/// `program` has the kernels of level_order.cl.
LevelOrder level_order(Commands& commands, Program& program, const DeviceBinary& binary,
                       Plans& plans, Bvh& bvh);

}  // namespace bvhlab::opencl
