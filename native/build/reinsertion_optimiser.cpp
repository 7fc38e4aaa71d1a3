// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/reinsertion_optimiser.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <atomic>

namespace bvhlab {
namespace {

/// Nodes that move, as a share of all, below which iterations alternate between lock schemes.
constexpr double few = 0.02;
/// Nodes that move, as a share of all, before the tree is laid out anew.
constexpr double many = 0.02;
/// Levels above a node that count as near.
constexpr int generations_near = 4;

}  // namespace

ReinsertionOptimiser::ReinsertionOptimiser(const BinaryBvh& base, const CostModel& model,
                                           const Stopwatch& clock, Token& token, BuildLog& log,
                                           double leaf_cost)
    : base_(base),
      model_(model),
      clock_(clock),
      token_(token),
      log_(log),
      leaf_cost_(leaf_cost),
      tree_(reinsertion_tree(base, token)),
      moves_(tree_.slot_count()),
      active_(tree_.pairs.size()) {
    refit(tree_, token_);
    lay_out_depth_first(tree_, token_);
    cost_ = best_cost_ = lowest_cost_ = bvhlab::cost(tree_, model_, token_) + leaf_cost_;
    save(tree_, best_, token_);
    token_.report_cost(best_cost_);
    log_.steps.push_back({0, clock_.seconds(), best_cost_});
}

/// Calls `propose(search, pair, proposals)` for every pair but the root's, on the tree as it is.
template <class Propose>
void ReinsertionOptimiser::search_all(Propose&& propose) {
    moves_.proposals[0] = moves_.proposals[1] = {};          // the root, and no node at all
    constexpr std::uint64_t visits_between_checks = 100000;  // about a millisecond
    tbb::enumerable_thread_specific<ReinsertionSearch> searches(tree_);
    parallel_for_ranges(1, tree_.pairs.size(), 256, [&](const IndexRange& pairs) {
        ReinsertionSearch& search = searches.local();
        token_.check();
        std::uint64_t next_check = search.visits() + visits_between_checks;
        for (std::size_t pair = pairs.begin(); pair < pairs.end(); ++pair) {
            propose(search, std::uint32_t(pair), &moves_.proposals[2 * pair]);
            if (search.visits() < next_check) continue;
            token_.check();
            next_check = search.visits() + visits_between_checks;
        }
    });
}

bool ReinsertionOptimiser::climb(std::uint32_t iteration, std::uint32_t sparsity, int lock_rounds,
                                 double threshold) {
    const bool all = all_search_ || sparsity > 1;
    search_all([&](ReinsertionSearch& search, std::uint32_t pair, Reinsertion* proposals) {
        std::array<BestReinsertion, 2> choices;
        if (all ? pair % sparsity == iteration % sparsity : active_[pair] != 0)
            search.run(pair, choices, {true, true});
        for (const int side : {0, 1}) proposals[side] = choices[std::size_t(side)].best;
    });

    // With few locks more nodes move at once, but pairs of moves that only make sense one without
    // the other may be made and undone for ever: alternate once the tree comes to rest.
    locked_more_ = few_moved_ && !locked_more_;
    mark_surroundings();
    moved_ =
        moves_.make(tree_, locked_more_ ? Locks::aggressive : Locks::minimal, lock_rounds, token_);
    few_moved_ = double(moved_) < few * double(tree_.slot_count());
    const bool laid_out = finish(iteration);
    // Costs may also go up and down at rest. A search by all that ends a series of searches by some
    // would lower the cost by several times as much as one in a series.
    const double drop = lowest_cost_ - cost_;
    const bool at_rest = moved_ == 0 || drop <= (some_rested_ ? 10.0 * threshold : threshold);
    lowest_cost_ = std::min(lowest_cost_, cost_);
    some_rested_ = at_rest && !all;
    all_search_ = laid_out || !few_moved_ || at_rest;
    return at_rest && all;
}

/// Marks the pairs whose boxes or neighbours the proposals would change: those of the nodes below
/// and of some generations above node and target.
void ReinsertionOptimiser::mark_surroundings() {
    constexpr std::size_t grain = 4096;
    parallel_for_each(active_.size(), grain, token_, [&](std::size_t pair) { active_[pair] = 0; });
    const auto mark = [&](std::uint32_t pair) {
        std::atomic_ref<std::uint8_t>(active_[pair]).store(1, std::memory_order_relaxed);
    };
    const auto mark_around = [&](std::uint32_t slot) {
        const std::uint32_t child = tree_.child(slot);
        if (!tree_.is_leaf(child)) mark(child);
        for (int generation = 0; generation < generations_near; ++generation) {
            if (slot < 2) return;
            mark(slot / 2);
            slot = tree_.parent(slot);
        }
    };
    parallel_for_each(moves_.proposals.size(), grain, token_, [&](std::size_t slot) {
        const std::uint32_t target = moves_.proposals[slot].target;
        if (target == Reinsertion::none) return;
        mark_around(std::uint32_t(slot));
        mark_around(tree_.sibling(std::uint32_t(slot)));
        mark_around(target);
    });
}

void ReinsertionOptimiser::heat(const Heat& heat, std::uint32_t sparsity, int lock_rounds) {
    search_all([&](ReinsertionSearch& search, std::uint32_t pair, Reinsertion* proposals) {
        std::array<AnnealedReinsertion, 2> choices{AnnealedReinsertion(heat, 2 * pair),
                                                   AnnealedReinsertion(heat, 2 * pair + 1)};
        const std::array<bool, 2> searching{choices[0].takes_part(sparsity),
                                            choices[1].takes_part(sparsity)};
        if (searching[0] || searching[1]) search.run(pair, choices, searching);
        for (const int side : {0, 1}) proposals[side] = choices[std::size_t(side)].accepted;
    });
    moved_ = moves_.make(tree_, Locks::conservative, lock_rounds, token_);
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
        refit(tree_, token_);
        moved_since_layout_ += moved_;
        if (double(moved_since_layout_) > many * double(tree_.slot_count())) {
            lay_out_depth_first(tree_, token_);
            moved_since_layout_ = 0;
            laid_out = true;
        }
        cost_ = bvhlab::cost(tree_, model_, token_) + leaf_cost_;
        if (cost_ < best_cost_) {
            best_cost_ = cost_;
            save(tree_, best_, token_);
        }
    }
    token_.report_cost(best_cost_);
    log_.steps.push_back({iteration, clock_.seconds(), best_cost_});
    return laid_out;
}

}  // namespace bvhlab
