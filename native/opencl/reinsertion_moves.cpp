// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/reinsertion_moves.h"

namespace bvhlab::opencl {
namespace {

// As in kernels/reinsertion_moves.cl.
constexpr std::uint32_t ask_whole = 0, ask_gain = 1, ask_slot = 2;
static_assert(int(Locks::minimal) == 0 && int(Locks::aggressive) == 1 &&
              int(Locks::conservative) == 2);

}  // namespace

ReinsertionMoves::ReinsertionMoves(Commands& commands, std::size_t slot_count, bool split_keys)
    : commands_(commands),
      slot_count_(std::uint32_t(slot_count)),
      split_keys_(split_keys),
      program_(commands.device(),
               {{"reinsertion_tree.cl", "reinsertion_moves.cl"}, split_keys ? "-DSPLIT_KEYS" : ""}),
      keys_(commands.buffer<std::uint64_t>(slot_count)),
      states_(commands.buffer<std::uint8_t>(slot_count)),
      won_(commands.buffer<std::uint32_t>(1)) {}

void ReinsertionMoves::lock(const ReinsertionTree& tree, const Buffer<Reinsertion>& proposals,
                            Locks locks, bool first_round) {
    const auto scheme = std::uint32_t(locks);
    commands_.fill(keys_, std::uint64_t(0));
    if (!first_round) {
        commands_.run(program_["take_locks"], slot_count_, tree.parents(), proposals, slot_count_,
                      scheme, states_, keys_);
        commands_.run(program_["drop_losers"], slot_count_, tree.parents(), proposals, slot_count_,
                      scheme, keys_, states_);
    }
    const auto ask = [&](std::uint32_t pass) {
        commands_.run(program_["ask_locks"], slot_count_, tree.parents(), proposals, slot_count_,
                      scheme, pass, states_, keys_);
    };
    if (split_keys_) {
        ask(ask_gain);
        ask(ask_slot);
    } else {
        ask(ask_whole);
    }
}

std::size_t ReinsertionMoves::make(const ReinsertionTree& tree,
                                   const Buffer<Reinsertion>& proposals, Locks locks, int rounds) {
    commands_.stage("locking");
    commands_.run(program_["open_moves"], slot_count_, proposals, slot_count_, states_);
    commands_.fill(won_, std::uint32_t(0));

    // Decide on all first, as moves change the ways between nodes and targets.
    std::size_t won = 0;
    for (int round = 0; round < rounds; ++round) {
        lock(tree, proposals, locks, round == 0);
        commands_.run(program_["decide"], slot_count_, tree.parents(), proposals, slot_count_,
                      std::uint32_t(locks), keys_, states_, won_, Local{sizeof(std::uint32_t)});
        const std::size_t all = commands_.value(won_, 0);
        if (all == won) break;
        won = all;
    }
    commands_.stage("moving");
    if (won > 0)
        commands_.run(program_["reinsert"], slot_count_, proposals, states_, slot_count_,
                      tree.pairs(), tree.parents());
    return won;
}

}  // namespace bvhlab::opencl
