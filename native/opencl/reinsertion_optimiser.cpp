// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/reinsertion_optimiser.h"

#include <algorithm>

namespace bvhlab::opencl {
namespace {

// As in build/reinsertion_optimiser.cpp: shares of all nodes that move.
constexpr double few = 0.02;   // below, iterations alternate between lock schemes
constexpr double many = 0.02;  // above, the tree is laid out anew

}  // namespace

ReinsertionOptimiser::ReinsertionOptimiser(Commands& commands, const DeviceBinary& base,
                                           const CostModel& model, const Stopwatch& clock,
                                           Token& token, BuildLog& log, bool split_keys)
    : base_(base),
      model_(model),
      clock_(clock),
      token_(token),
      log_(log),
      tree_(commands, base),
      search_(commands, tree_),
      moves_(commands, tree_.slot_count(),
             split_keys || !commands.device().info().has_long_atomics),
      best_(commands.buffer<glm::uvec2>(tree_.pair_count())) {
    tree_.refit();
    tree_.lay_out_depth_first();
    cost_ = best_cost_ = lowest_cost_ = tree_.cost(model_);
    tree_.save(best_);
    token_.report_cost(best_cost_);
    log_.steps.push_back({0, clock_.seconds(), best_cost_});
}

bool ReinsertionOptimiser::climb(std::uint32_t iteration, std::uint32_t sparsity, int lock_rounds,
                                 double threshold) {
    const bool all = all_search_ || sparsity > 1;
    if (all)
        search_.climb(sparsity, iteration % sparsity);
    else
        search_.climb_near();

    // Why the lock schemes alternate, and when costs are at rest: see the host's.
    locked_more_ = few_moved_ && !locked_more_;
    search_.mark_surroundings();
    moved_ = moves_.make(tree_, search_.proposals(),
                         locked_more_ ? Locks::aggressive : Locks::minimal, lock_rounds);
    few_moved_ = double(moved_) < few * double(tree_.slot_count());
    const bool laid_out = finish(iteration);
    const double drop = lowest_cost_ - cost_;
    const bool at_rest = moved_ == 0 || drop <= (some_rested_ ? 10.0 * threshold : threshold);
    lowest_cost_ = std::min(lowest_cost_, cost_);
    some_rested_ = at_rest && !all;
    all_search_ = laid_out || !few_moved_ || at_rest;
    return at_rest && all;
}

void ReinsertionOptimiser::heat(const Heat& heat, std::uint32_t sparsity, int lock_rounds) {
    search_.heat(heat, sparsity);
    moved_ = moves_.make(tree_, search_.proposals(), Locks::conservative, lock_rounds);
    few_moved_ = false;
    all_search_ = true;
    finish(std::uint32_t(heat.iteration));
    some_rested_ = false;
    lowest_cost_ = cost_;
}

/// Brings boxes, layout and cost up to date. Returns whether the layout has changed.
bool ReinsertionOptimiser::finish(std::uint32_t iteration) {
    bool laid_out = false;
    if (moved_ > 0) {
        tree_.refit();
        moved_since_layout_ += moved_;
        if (double(moved_since_layout_) > many * double(tree_.slot_count())) {
            tree_.lay_out_depth_first();
            moved_since_layout_ = 0;
            laid_out = true;
        }
        cost_ = tree_.cost(model_);
        if (cost_ < best_cost_) {
            best_cost_ = cost_;
            tree_.save(best_);
        }
    }
    token_.report_cost(best_cost_);
    log_.steps.push_back({iteration, clock_.seconds(), best_cost_});
    return laid_out;
}

}  // namespace bvhlab::opencl
