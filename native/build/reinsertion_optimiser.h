// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.h"
#include "base/token.h"
#include "build/annealing_choice.h"
#include "build/build_log.h"
#include "build/reinsertion_moves.h"
#include "build/reinsertion_tree.h"

namespace bvhlab {

/// A tree that is improved by parallel reinsertion, one iteration per call, and the best state it
/// has been in. The same for any thread count.
///
/// Costs are Eq. 2 with one reference per leaf. Every iteration is reported to the token and the
/// log. All members throw Cancelled, within milliseconds of the wish.
class ReinsertionOptimiser {
public:
    /// Starts from `base`, which must outlive it, and logs it as iteration 0 at `clock`'s time.
    /// `leaf_cost` is added to every cost: that of what is below the leaves, where they stand for
    /// more than one reference.
    ReinsertionOptimiser(const BinaryBvh& base, const CostModel& model, const Stopwatch& clock,
                         Token& token, BuildLog& log, double leaf_cost = 0.0);

    /// One iteration of hill climbing (Meister and Bittner 2018b). All nodes whose pair is
    /// `iteration` modulo `sparsity` search for their best reinsertion.
    ///
    /// Once few nodes move and `sparsity` is 1, only those near a node that wanted to move in the
    /// iteration before search, until that lowers the cost by no more than `threshold`; then all
    /// search again. Returns whether all have searched and lowered it by no more than that, or than
    /// ten times as much right after a series of iterations of some nodes.
    bool climb(std::uint32_t iteration, std::uint32_t sparsity, int lock_rounds, double threshold);

    /// Simulated annealing (paper, section 2.2) at a positive temperature, for a random one in
    /// `sparsity` nodes.
    void heat(const Heat& heat, std::uint32_t sparsity, int lock_rounds);

    std::size_t moved() const { return moved_; }  ///< reinsertions of the last iteration
    double cost() const { return cost_; }
    double best_cost() const { return best_cost_; }
    const ReinsertionTree& tree() const { return tree_; }

    /// The best tree, with the boxes of the base's leaves, numbered depth-first.
    BinaryBvh best() const { return binary_bvh(best_, base_, token_); }

private:
    template <class Propose>
    void search_all(Propose&& propose);
    void mark_surroundings();
    bool finish(std::uint32_t iteration);

    const BinaryBvh& base_;
    const CostModel& model_;
    const Stopwatch& clock_;
    Token& token_;
    BuildLog& log_;
    double leaf_cost_;

    ReinsertionTree tree_;
    ReinsertionMoves moves_;
    std::size_t moved_ = 0;
    std::size_t moved_since_layout_ = 0;
    bool few_moved_ = false, locked_more_ = false;
    bool all_search_ = true;      // in the next iteration
    bool some_rested_ = false;    // the last iteration was of some nodes and at rest
    Array<std::uint8_t> active_;  // by pair: may search in the next iteration
    double cost_ = 0.0, best_cost_ = 0.0;
    double lowest_cost_ = 0.0;  // since the last heating
    Topology best_;
};

}  // namespace bvhlab
