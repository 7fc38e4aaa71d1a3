// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/reinsertion_tree.h"

#include <algorithm>
#include <bit>
#include <span>
#include <utility>

namespace bvhlab::opencl {
namespace {

static_assert(sizeof(SlotPair) == 64);

/// As in kernels/reinsertion_pairs.cl.
struct UnitScale {
    float origin[3];
    float unused;
    double scale;
};

/// As the host's: lower corner 0, longest side 1.
UnitScale unit_scale(const Box& scene) {
    double longest = 0.0;
    for (int axis = 0; axis < 3; ++axis)
        longest = std::max(longest, double(scene.upper[axis]) - double(scene.lower[axis]));
    return {
        {scene.lower.x, scene.lower.y, scene.lower.z}, 0.0F, longest > 0.0 ? 1.0 / longest : 1.0};
}

// --- the host's order of sums -------------------------------------------------------------------
// bvhlab::cost() adds up the pairs from 1 on by parallel_sum, which halves ranges until they are of
// `grain` pairs at most.

constexpr std::uint32_t grain = 2048;

std::uint32_t middle(std::uint32_t begin, std::uint32_t end) {
    return begin + (end - begin) / 2;
}

void add_ranges(std::uint32_t begin, std::uint32_t end, std::vector<glm::uvec2>& ranges) {
    if (end - begin <= grain) {
        ranges.push_back({begin, end});
        return;
    }
    add_ranges(begin, middle(begin, end), ranges);
    add_ranges(middle(begin, end), end, ranges);
}

/// Adds up the ranges' sums, beginning with `*next`, which is advanced.
double joined_sum(std::uint32_t begin, std::uint32_t end, const double** next) {
    if (end - begin <= grain) return *(*next)++;
    const double left = joined_sum(begin, middle(begin, end), next);
    return left + joined_sum(middle(begin, end), end, next);
}

/// Where the paths of each rank are: those of rank 1 by pair, then at most count / 2^rank of the
/// others (kernels/reinsertion_paths.cl). One more than there are ranks.
std::vector<std::uint32_t> paths_by_rank(std::uint32_t count) {
    std::vector<std::uint32_t> first{0, 0, count};
    for (std::uint32_t rank = 2; count >> rank; ++rank)
        first.push_back(first.back() + (count >> rank));
    return first;
}

}  // namespace

ReinsertionTree::ReinsertionTree(Commands& commands, const DeviceBinary& base)
    : commands_(commands),
      program_(commands.device(), {{"reinsertion_tree.cl", "reinsertion_pairs.cl"}, ""}),
      refit_(commands.device(), {{"reinsertion_tree.cl", "reinsertion_paths.cl"}, ""}),
      sums_(commands.device(), {{"reinsertion_tree.cl", "reinsertion_cost.cl"}, ""}),
      pair_count_(base.reference_count()),
      pairs_(commands.buffer<SlotPair>(pair_count_)),
      spare_pairs_(commands.buffer<SlotPair>(pair_count_)),
      parents_(commands.buffer<std::uint32_t>(pair_count_)),
      spare_parents_(commands.buffer<std::uint32_t>(pair_count_)),
      first_paths_(paths_by_rank(std::uint32_t(pair_count_))),
      paths_(commands.buffer<std::uint32_t>(first_paths_.back())),
      path_counts_(commands.buffer<std::uint32_t>(34)),  // ranks are at most 32
      sizes_(commands.buffer<std::uint32_t>(pair_count_)),
      arrivals_(commands.buffer<std::uint32_t>(pair_count_)),
      ranks_(commands.buffer<std::uint8_t>(pair_count_)),
      places_(commands.buffer<glm::uvec2>(pair_count_)),
      weights_(commands.buffer<double>(pair_count_)) {
    add_ranges(1, std::uint32_t(pair_count_), ranges_);
    device_ranges_ = commands.upload(std::span(ranges_));
    range_sums_ = commands.buffer<double>(ranges_.size() + 2);
    const UnitScale unit = unit_scale(commands.value(base.boxes, 0));
    commands.stage("laying out");
    commands.run(program_["make_pairs"], pair_count_, base.boxes, base.children,
                 std::uint32_t(pair_count_), unit, pairs_, parents_);
}

/// `program` has the two kernels with its own visit.
template <class... VisitArguments>
void ReinsertionTree::walk_up(Program& program, const VisitArguments&... visit_arguments) {
    commands_.fill(arrivals_, std::uint32_t(0));
    commands_.fill(path_counts_, std::uint32_t(0));
    commands_.run(program["walk_up_from_leaves"], pair_count_, visit_arguments..., pairs_, parents_,
                  sizes_, ranks_, arrivals_, std::uint32_t(pair_count_), first_paths_[2], paths_,
                  path_counts_);
    for (std::uint32_t rank = 2; rank + 1 < first_paths_.size(); ++rank)
        commands_.run(program["walk_up_from_paths"], pair_count_ >> rank, visit_arguments...,
                      pairs_, parents_, sizes_, ranks_, arrivals_, rank, first_paths_[rank],
                      first_paths_[rank + 1], paths_, path_counts_);
}

void ReinsertionTree::walk_down() {
    for (auto rank = std::uint32_t(first_paths_.size() - 2); rank >= 1; --rank)
        commands_.run(refit_["walk_down"], rank == 1 ? pair_count_ : pair_count_ >> rank, pairs_,
                      parents_, sizes_, ranks_, rank, first_paths_[rank], paths_, path_counts_,
                      places_);
}

void ReinsertionTree::refit() {
    commands_.stage("refitting");
    walk_up(refit_);
}

void ReinsertionTree::lay_out_depth_first() {
    commands_.stage("laying out");
    walk_down();
    commands_.run(program_["lay_out_pairs"], pair_count_, pairs_, parents_, places_,
                  std::uint32_t(pair_count_), spare_pairs_, spare_parents_);
    std::swap(pairs_, spare_pairs_);
    std::swap(parents_, spare_parents_);
}

double ReinsertionTree::cost(const CostModel& model) {
    commands_.stage("summing costs");
    commands_.run(sums_["weigh_pairs"], pair_count_, pairs_, std::uint32_t(pair_count_),
                  model.traversal, model.intersection, weights_);
    commands_.run(sums_["sum_ranges"], ranges_.size() + 1, weights_, device_ranges_,
                  std::uint32_t(ranges_.size()), pairs_, range_sums_);
    std::vector<double> sums(ranges_.size() + 2);
    commands_.download(range_sums_, std::span(sums));
    const double root_area = sums.back(), root_weight = sums[ranges_.size()];
    if (root_area <= 0.0) return model.traversal;
    const double* next = sums.data();
    return (root_weight + joined_sum(1, std::uint32_t(pair_count_), &next)) / root_area;
}

void ReinsertionTree::save(const Topology& topology) {
    commands_.stage("keeping the best tree");
    commands_.run(program_["save_topology"], pair_count_, pairs_, std::uint32_t(pair_count_),
                  topology);
}

DeviceBinary ReinsertionTree::binary_bvh(const Topology& topology, const DeviceBinary& base) {
    commands_.stage("keeping the best tree");
    DeviceBinary bvh = DeviceBinary::with_references(commands_, pair_count_);
    if (pair_count_ == 1) {
        commands_.copy(base.boxes, bvh.boxes, 1);
        commands_.copy(base.references, bvh.references, 1);
        return bvh;
    }
    const auto count = std::uint32_t(pair_count_);
    commands_.run(program_["restore_topology"], pair_count_, topology, count, pairs_, parents_);
    const auto pair_boxes = commands_.buffer<Box>(pair_count_);
    Program exact(commands_.device(),
                  {{"reinsertion_tree.cl", "reinsertion_paths.cl"}, "-DEXACT_BOXES"});
    walk_up(exact, base.boxes, base.first_leaf(), pair_boxes);
    walk_down();
    commands_.run(program_["write_nodes"], pair_count_, pairs_, places_, sizes_, pair_boxes, count,
                  base.boxes, base.references, bvh.boxes, bvh.children, bvh.references);
    commands_.finish();  // before what they use goes
    return bvh;
}

}  // namespace bvhlab::opencl
