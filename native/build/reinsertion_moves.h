// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "build/reinsertion_search.h"
#include "build/reinsertion_tree.h"

namespace bvhlab {

/// Which slots a reinsertion locks (Meister and Bittner 2018b, section 3.2; paper, section 2.2).
///
/// The first two do not keep two subtrees from being inserted into each other, which would cut both
/// off the tree. They are safe for the moves of BestReinsertion: it enters only nodes of larger
/// area than the one removed. So where a node A moves below a node B that moves too, and did not
/// contain A before, B is larger than A; where it did contain A, it is at least as large and above
/// A. Going from moved node to moved node above it, areas never shrink, and they stay equal only
/// along ways up the old tree: one never comes back to the first.
enum class Locks {
    minimal,       ///< the four slots that change: node, sibling, parent, target
    aggressive,    ///< and the parents of parent and target, as with nodes linked both ways
    conservative,  ///< `minimal` and all nodes between node and target; safe for any moves
};

/// Makes reinsertions in parallel, none of which hinders another.
class ReinsertionMoves {
public:
    explicit ReinsertionMoves(std::size_t slot_count)
        : proposals(slot_count), keys_(slot_count), states_(slot_count) {}

    Array<Reinsertion> proposals;  ///< by slot of the node, all to be filled before make()

    /// Makes those proposals that win all their locks, and returns how many. Boxes above are not
    /// refitted. The larger gain wins a lock, but any negative gain before any other, the more
    /// negative one first; the slot decides between equal gains. Further rounds let those try again
    /// that lost to losers only; the paper has one round. Throws Cancelled.
    std::size_t make(ReinsertionTree& tree, Locks locks, int rounds, const Token& token);

private:
    enum class State : std::uint8_t { out, asks, won };

    void lock(const ReinsertionTree& tree, Locks locks, bool first_round, const Token& token);
    std::size_t decide(const ReinsertionTree& tree, Locks locks, const Token& token);

    Array<std::uint64_t> keys_;  // by slot, the highest key of those who ask for it
    Array<State> states_;        // by slot of the node
};

}  // namespace bvhlab
