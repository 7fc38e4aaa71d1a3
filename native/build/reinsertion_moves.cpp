// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/reinsertion_moves.h"

#include <atomic>
#include <bit>
#include <functional>

#include "base/parallel.h"

namespace bvhlab {
namespace {

constexpr std::size_t grain = 2048;
constexpr std::uint64_t taken = ~std::uint64_t(0);  // above every key

/// Positive floats order as their bits do; those of negative ones are larger, the more the more
/// negative, which is the priority wanted. No two keys are equal and none is 0.
std::uint64_t key(const Reinsertion& move, std::size_t slot) {
    return std::uint64_t(std::bit_cast<std::uint32_t>(move.gain)) << 32 | slot;
}

/// Calls `use(slot)` for every slot that the reinsertion locks, some more than once, until it
/// returns false. Returns whether it never did.
template <class Use>
bool all_locked(const ReinsertionTree& tree, std::size_t slot_index, const Reinsertion& move,
                Locks locks, Use&& use) {
    const auto slot = std::uint32_t(slot_index);
    const std::uint32_t parent = tree.parent(slot), target = move.target;
    if (!(use(slot) && use(tree.sibling(slot)) && use(parent) && use(target))) return false;
    if (locks == Locks::minimal) return true;
    if (locks == Locks::aggressive) return use(tree.parent(parent)) && use(tree.parent(target));

    // Up to the pivot, and from its sibling down to the target, or the other way round.
    for (std::uint32_t node = slot; node != move.pivot;) {
        node = tree.parent(node);
        if (!use(node)) return false;
    }
    if (target == move.pivot) return true;
    for (std::uint32_t node = target; node != tree.sibling(move.pivot);) {
        node = tree.parent(node);
        if (!use(node)) return false;
    }
    return true;
}

void raise(std::uint64_t& value, std::uint64_t least) {
    const std::atomic_ref<std::uint64_t> shared(value);
    std::uint64_t now = shared.load(std::memory_order_relaxed);
    while (now < least && !shared.compare_exchange_weak(now, least, std::memory_order_relaxed)) {
    }
}

/// The node stays in its slot. Its sibling takes the parent's slot, the target takes the sibling's,
/// and the target's old slot becomes their parent. Right also where the target is an ancestor or
/// below the sibling.
void reinsert(ReinsertionTree& tree, std::uint32_t slot, std::uint32_t target) {
    const std::uint32_t sibling = tree.sibling(slot);
    tree.move_node(sibling, tree.parent(slot));
    tree.move_node(target, sibling);
    tree.set_child(target, slot / 2);
}

}  // namespace

void ReinsertionMoves::lock(const ReinsertionTree& tree, Locks locks, bool first_round,
                            const Token& token) {
    const std::size_t count = proposals.size();
    parallel_for_each(count, 8 * grain, token, [&](std::size_t slot) { keys_[slot] = 0; });
    if (!first_round) {
        parallel_for_each(count, grain, token, [&](std::size_t slot) {
            if (states_[slot] == State::won)
                all_locked(tree, slot, proposals[slot], locks,
                           [&](std::uint32_t node) { return keys_[node] = taken, true; });
        });
        parallel_for_each(count, grain, token, [&](std::size_t slot) {
            if (states_[slot] == State::asks &&
                !all_locked(tree, slot, proposals[slot], locks,
                            [&](std::uint32_t node) { return keys_[node] != taken; }))
                states_[slot] = State::out;
        });
    }
    parallel_for_each(count, grain, token, [&](std::size_t slot) {
        if (states_[slot] != State::asks) return;
        const std::uint64_t own = key(proposals[slot], slot);
        all_locked(tree, slot, proposals[slot], locks,
                   [&](std::uint32_t node) { return raise(keys_[node], own), true; });
    });
}

std::size_t ReinsertionMoves::decide(const ReinsertionTree& tree, Locks locks, const Token& token) {
    const auto decide_range = [&](const IndexRange& slots, std::size_t won) {
        token.check();
        for (std::size_t slot = slots.begin(); slot < slots.end(); ++slot) {
            if (states_[slot] != State::asks) continue;
            const std::uint64_t own = key(proposals[slot], slot);
            if (!all_locked(tree, slot, proposals[slot], locks,
                            [&](std::uint32_t node) { return keys_[node] == own; }))
                continue;
            states_[slot] = State::won;
            ++won;
        }
        return won;
    };
    return parallel_sum(0, proposals.size(), grain, std::size_t(0), decide_range);
}

std::size_t ReinsertionMoves::make(ReinsertionTree& tree, Locks locks, int rounds,
                                   const Token& token) {
    parallel_for_each(proposals.size(), 8 * grain, token, [&](std::size_t slot) {
        states_[slot] = proposals[slot].target == Reinsertion::none ? State::out : State::asks;
    });

    // Decide on all first, as moves change the ways between nodes and targets.
    std::size_t won = 0;
    for (int round = 0; round < rounds; ++round) {
        lock(tree, locks, round == 0, token);
        const std::size_t more = decide(tree, locks, token);
        if (more == 0) break;
        won += more;
    }
    parallel_for_each(proposals.size(), grain, token, [&](std::size_t slot) {
        if (states_[slot] == State::won)
            reinsert(tree, std::uint32_t(slot), proposals[slot].target);
    });
    return won;
}

}  // namespace bvhlab
