// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/token.h"
#include "build/build_log.h"
#include "build/treelet.h"
#include "bvh/cost.h"
#include "opencl/commands.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// Interior nodes of a tree, level by level: no node of a level is below another of it, and all of
/// them that are below a node come before it.
struct TreeletLevels {
    Buffer<std::uint32_t> nodes;
    std::vector<std::uint32_t> begins;  ///< of each level in `nodes`, and the end
};

/// Puts treelets into the queue that are rooted at `count` nodes from `first` on, all of one level.
/// Its kernels may change what is below a root and the root's links, keep the reference counts
/// true, and write at the root's place in `savings` by how much they reduced the half areas of
/// interior nodes.
using RestructureTreelets =
    std::function<void(const Buffer<std::uint32_t>& nodes, std::uint32_t first, std::uint32_t count,
                       const Buffer<double>& savings)>;

/// Passes over the treelets of a tree. Throws as Commands.
class TreeletPasses {
public:
    /// Counts the references below each interior node. `bvh` must outlive this.
    TreeletPasses(Commands& commands, const DeviceBinary& bvh);

    /// By interior node: references below it.
    const Buffer<std::uint32_t>& references() const { return references_; }

    /// All interior nodes of at least `gamma` references, which the root must have.
    TreeletLevels find_levels(std::size_t gamma);

    /// As bvhlab::restructure_treelets, with the same treelets in an order that gives the same
    /// tree. Costs in the log are the CPU's but for the rounding of sums.
    void run(const RestructuringLimits& limits, const CostModel& model, const Stopwatch& watch,
             Token& token, BuildLog& log, const RestructureTreelets& restructure);

private:
    struct Share {
        float begin, end;  // of the stage's work
    };

    std::uint32_t interior_count() const { return bvh_.first_leaf(); }
    double cost(const CostModel& model, double root_area);
    double pass(std::size_t gamma, const std::function<bool()>& out_of_time, Token& token,
                Share share, const RestructureTreelets& restructure);
    double total();

    Commands& commands_;
    const DeviceBinary& bvh_;
    Program program_;
    Buffer<std::uint32_t> references_, arrived_, heights_, places_;  // by interior node
    Buffer<std::uint32_t> parents_;                                  // by node
    Buffer<std::uint32_t> root_count_;                               // one
    Buffer<double> sums_;                                            // by strand
};

/// How treelets are shared out to work-items: where that suits a GPU, to the lanes of a group each.
/// A CPU has treelets enough for all of its cores, and one lane spends nothing on sharing.
struct TreeletLanes {
    std::size_t lanes;
    Local memory;  ///< of a group

    /// `more_memory`: bytes needed beside the treelet itself.
    TreeletLanes(const Commands& commands, int treelet_size, std::size_t more_memory);

    /// Of a program that has treelet.cl.
    std::string options(int treelet_size) const;

    Range range(std::size_t treelets) const;
};

}  // namespace bvhlab::opencl
