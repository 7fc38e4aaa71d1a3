// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "build/reinsertion_moves.h"
#include "opencl/reinsertion_tree.h"

namespace bvhlab::opencl {

/// Makes reinsertions in parallel on a device, none of which hinders another: those that
/// bvhlab::ReinsertionMoves would make. Throws as Commands does.
class ReinsertionMoves {
public:
    /// `split_keys` does without atomics of 64 bits, as must be where the device has none.
    ReinsertionMoves(Commands& commands, std::size_t slot_count, bool split_keys);

    /// Makes those proposals, by slot of the node, that win all their locks in one of `rounds`, and
    /// returns how many. Boxes above are not refitted.
    std::size_t make(const ReinsertionTree& tree, const Buffer<Reinsertion>& proposals, Locks locks,
                     int rounds);

private:
    void lock(const ReinsertionTree& tree, const Buffer<Reinsertion>& proposals, Locks locks,
              bool first_round);

    Commands& commands_;
    std::uint32_t slot_count_;
    bool split_keys_;
    Program program_;
    Buffer<std::uint64_t> keys_;   // by slot, the highest key of those who ask for it
    Buffer<std::uint8_t> states_;  // by slot of the node
    Buffer<std::uint32_t> won_;    // how many, one number
};

}  // namespace bvhlab::opencl
