// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.h"
#include "base/token.h"
#include "build/build_log.h"
#include "opencl/reinsertion_moves.h"
#include "opencl/reinsertion_search.h"
#include "opencl/reinsertion_tree.h"

namespace bvhlab::opencl {

/// A tree on a device that is improved by parallel reinsertion, one iteration per call, and the
/// best state it has been in: bvhlab::ReinsertionOptimiser step by step, with the same trees and
/// costs.
///
/// Every iteration is reported to the token and the log. All members throw as Commands does.
class ReinsertionOptimiser {
public:
    /// Starts from `base`, which must outlive it, and logs it as iteration 0 at `clock`'s time.
    /// `split_keys` as in ReinsertionMoves, which all devices without atomics of 64 bits take.
    ReinsertionOptimiser(Commands& commands, const DeviceBinary& base, const CostModel& model,
                         const Stopwatch& clock, Token& token, BuildLog& log,
                         bool split_keys = false);

    /// One iteration of hill climbing; see the host's.
    bool climb(std::uint32_t iteration, std::uint32_t sparsity, int lock_rounds, double threshold);

    /// Simulated annealing at a positive temperature, for a random one in `sparsity` nodes.
    void heat(const Heat& heat, std::uint32_t sparsity, int lock_rounds);

    std::size_t moved() const { return moved_; }  ///< reinsertions of the last iteration
    double cost() const { return cost_; }
    double best_cost() const { return best_cost_; }

    /// The best tree, with the boxes of the base's leaves, numbered depth-first. The optimiser is
    /// of no use then.
    DeviceBinary best() { return tree_.binary_bvh(best_, base_); }

private:
    bool finish(std::uint32_t iteration);

    const DeviceBinary& base_;
    const CostModel& model_;
    const Stopwatch& clock_;
    Token& token_;
    BuildLog& log_;

    ReinsertionTree tree_;
    ReinsertionSearch search_;
    ReinsertionMoves moves_;
    ReinsertionTree::Topology best_;
    std::size_t moved_ = 0;
    std::size_t moved_since_layout_ = 0;
    bool few_moved_ = false, locked_more_ = false;
    bool all_search_ = true;    // in the next iteration
    bool some_rested_ = false;  // the last iteration was of some nodes and at rest
    double cost_ = 0.0, best_cost_ = 0.0;
    double lowest_cost_ = 0.0;  // since the last heating
};

}  // namespace bvhlab::opencl
