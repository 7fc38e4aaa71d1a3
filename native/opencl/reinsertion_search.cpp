// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/reinsertion_search.h"

#include <algorithm>
#include <vector>

namespace bvhlab::opencl {
namespace {

static_assert(sizeof(Reinsertion) == 12);

/// As in kernels/annealing.cl.
struct DeviceHeat {
    std::uint64_t seed, iteration;
    float temperature, prune_probability;
    std::uint32_t sparsity, unused;
};

// A launch of many searches is meant to take between these, in seconds: long enough for its
// overhead not to count, short enough for watchdogs and cancels.
constexpr double least_seconds = 0.05, most_seconds = 0.25;

/// Searches with deep stacks at a time: their stacks take 64 MiB.
constexpr std::size_t most_deep = 2048;

std::vector<std::string> files(const std::string& choice_file) {
    return {"reinsertion_tree.cl", choice_file, "reinsertion_search.cl"};
}

}  // namespace

ReinsertionSearch::ReinsertionSearch(Commands& commands, const ReinsertionTree& tree)
    : commands_(commands),
      tree_(tree),
      climbing_(commands.device(), {files("reinsertion_best.cl"), ""}),
      heating_(commands.device(), {files("annealing.cl"), ""}),
      proposals_(commands.buffer<Reinsertion>(tree.slot_count())),
      searchers_(commands.buffer<std::uint32_t>(tree.pair_count())),
      deep_(commands.buffer<std::uint32_t>(tree.pair_count())),
      counts_(commands.buffer<std::uint32_t>(2)),
      marks_(commands.buffer<std::uint8_t>(tree.pair_count())),
      // To begin with: even searches of most_visits each take no second then on a processor with
      // PoCL. For GPUs it is a guess.
      chunk_(1024 * std::size_t(std::max(1U, commands.device().info().compute_units))),
      deep_chunk_(std::min(chunk_, most_deep)) {}

/// Lists the pairs that search and clears all proposals.
template <class... Chosen>
void ReinsertionSearch::choose(Program& program, const Chosen&... chosen) {
    commands_.stage("searching");
    commands_.fill(counts_, std::uint32_t(0));
    commands_.run(program["choose_pairs"], tree_.pair_count(), std::uint32_t(tree_.pair_count()),
                  chosen..., proposals_, searchers_, counts_, Local{2 * sizeof(std::uint32_t)});
}

/// Calls `launch(first, count)` for all of `count` searches, as many at a time as take a tenth of a
/// second or so and `most` at most. How many that are does not show in the result.
template <class Launch>
void ReinsertionSearch::in_chunks(std::size_t count, std::size_t& chunk, std::size_t most,
                                  Launch&& launch) {
    for (std::size_t first = 0; first < count;) {
        const std::size_t size = std::min(chunk, count - first);
        commands_.finish();
        const double before = commands_.times().kernel_seconds();
        launch(std::uint32_t(first), std::uint32_t(size));
        commands_.finish();
        const double seconds = commands_.times().kernel_seconds() - before;
        if (size == chunk && seconds < least_seconds) chunk = std::min(2 * chunk, most);
        if (seconds > most_seconds) chunk = std::max<std::size_t>(chunk / 2, 64);
        first += size;
    }
}

template <class... ChoiceArguments>
void ReinsertionSearch::search(Program& program, const std::string& choice_file,
                               const ChoiceArguments&... choice_arguments) {
    const std::size_t count = commands_.value(counts_, 0);
    commands_.fill(counts_, std::uint32_t(0));
    in_chunks(count, chunk_, tree_.pair_count(), [&](std::uint32_t first, std::uint32_t size) {
        commands_.run(program["search"], size, tree_.pairs(), tree_.parents(), searchers_, first,
                      size, choice_arguments..., proposals_, deep_, counts_);
    });
    const std::size_t deep_count = count > 0 ? commands_.value(counts_, 0) : 0;
    if (deep_count == 0) return;
    if (stacks_.size() == 0)
        stacks_ = commands_.buffer<glm::uvec2>(most_deep * bvhlab::ReinsertionSearch::most_visits);
    Program deep(commands_.device(), {files(choice_file), "-DDEEP"});
    in_chunks(deep_count, deep_chunk_, most_deep, [&](std::uint32_t first, std::uint32_t size) {
        commands_.run(deep["search_deep"], size, tree_.pairs(), tree_.parents(), deep_, first, size,
                      choice_arguments..., proposals_, stacks_);
    });
}

void ReinsertionSearch::climb(std::uint32_t sparsity, std::uint32_t remainder) {
    choose(climbing_, std::uint32_t(1), sparsity, remainder, marks_);
    search(climbing_, "reinsertion_best.cl");
}

void ReinsertionSearch::climb_near() {
    choose(climbing_, std::uint32_t(0), std::uint32_t(1), std::uint32_t(0), marks_);
    search(climbing_, "reinsertion_best.cl");
}

void ReinsertionSearch::heat(const Heat& heat, std::uint32_t sparsity) {
    const DeviceHeat shared{
        heat.seed, heat.iteration, heat.temperature, heat.prune_probability, sparsity, 0};
    choose(heating_, shared);
    search(heating_, "annealing.cl", shared);
}

void ReinsertionSearch::mark_surroundings() {
    commands_.stage("searching");
    commands_.fill(marks_, std::uint8_t(0));
    commands_.run(climbing_["mark_surroundings"], tree_.slot_count(), tree_.pairs(),
                  tree_.parents(), proposals_, std::uint32_t(tree_.slot_count()), marks_);
}

}  // namespace bvhlab::opencl
