// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <vector>

#include "build/reinsertion_tree.h"
#include "bvh/cost.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// A binary tree on a device as the reinsertion builders work on it: bvhlab::ReinsertionTree bit
/// for bit, and what is done with all of it at once. Members throw as Commands does.
class ReinsertionTree {
public:
    /// What is a child of what: SlotPair::child by pair.
    using Topology = Buffer<glm::uvec2>;

    ReinsertionTree(Commands& commands, const DeviceBinary& base);

    std::size_t pair_count() const { return pair_count_; }
    std::size_t slot_count() const { return 2 * pair_count_; }
    const Buffer<SlotPair>& pairs() const { return pairs_; }
    const Buffer<std::uint32_t>& parents() const { return parents_; }

    /// Recomputes the boxes and areas of all interior nodes.
    void refit();

    /// Moves the pairs into depth-first order. The tree must not have changed since refit().
    void lay_out_depth_first();

    /// Eq. 2 with one reference per leaf, in double; bit for bit what the host's cost() gives.
    double cost(const CostModel& model);

    /// Copies the topology.
    void save(const Topology& topology);

    /// The tree with that topology over the leaves of `base`, the one it was made from, in
    /// depth-first order, its boxes made from the base's leaf boxes. This tree is of no use then.
    DeviceBinary binary_bvh(const Topology& topology, const DeviceBinary& base);

private:
    template <class... VisitArguments>
    void walk_up(Program& program, const VisitArguments&... visit_arguments);
    void walk_down();

    Commands& commands_;
    Program program_, refit_, sums_;
    std::size_t pair_count_;
    Buffer<SlotPair> pairs_, spare_pairs_;           // one is laid out anew into the other
    Buffer<std::uint32_t> parents_, spare_parents_;  // by pair, the slot of the parent

    // kernels/reinsertion_paths.cl says what these are.
    std::vector<std::uint32_t> first_paths_;     // by rank, where its paths are
    Buffer<std::uint32_t> paths_, path_counts_;  // by path; by rank
    Buffer<std::uint32_t> sizes_, arrivals_;     // by pair
    Buffer<std::uint8_t> ranks_;                 // by pair
    Buffer<glm::uvec2> places_;                  // by pair

    Buffer<double> weights_, range_sums_;  // by pair; by range and two more
    std::vector<glm::uvec2> ranges_;       // of pairs that the host adds up in a row
    Buffer<glm::uvec2> device_ranges_;
};

}  // namespace bvhlab::opencl
