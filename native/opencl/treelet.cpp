// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/treelet.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "opencl/radix_sort.h"
#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

/// Sums that are made at the same time; the host adds them up.
constexpr std::uint32_t strands = 8192;

/// Treelets in the queue at most: a launch, and the wait for all of them after a cancel, must stay
/// short. A CPU core takes about 5 us for one.
std::uint32_t most_queued(const Commands& commands) {
    return commands.suits_gpu ? 65536 : 4096;
}

}  // namespace

TreeletPasses::TreeletPasses(Commands& commands, const DeviceBinary& bvh)
    : commands_(commands),
      bvh_(bvh),
      program_(commands.device(), {{"treelet_passes.cl"}, ""}),
      references_(commands.buffer<std::uint32_t>(interior_count())),
      arrived_(commands.buffer<std::uint32_t>(interior_count())),
      heights_(commands.buffer<std::uint32_t>(interior_count())),
      places_(commands.buffer<std::uint32_t>(interior_count())),
      parents_(commands.buffer<std::uint32_t>(bvh.boxes.size())),
      root_count_(commands.buffer<std::uint32_t>(1)),
      sums_(commands.buffer<double>(strands)) {
    if (interior_count() == 0) return;
    commands_.stage("reference counts");
    commands_.run(program_["find_parents"], interior_count(), bvh_.children, interior_count(),
                  parents_, arrived_);
    commands_.run(program_["count_references"], bvh_.reference_count(), parents_, interior_count(),
                  arrived_, references_);
}

TreeletLevels TreeletPasses::find_levels(std::size_t gamma) {
    commands_.stage("treelet levels");
    const auto least = std::uint32_t(gamma);
    commands_.run(program_["find_parents"], interior_count(), bvh_.children, interior_count(),
                  parents_, arrived_);
    commands_.run(program_["find_heights"], interior_count(), bvh_.children, references_, parents_,
                  interior_count(), least, arrived_, heights_, places_);
    exclusive_scan(commands_, places_, interior_count(), root_count_);
    const std::uint32_t count = commands_.value(root_count_, 0);
    const std::uint32_t highest = commands_.value(heights_, 0);

    TreeletLevels levels{commands_.buffer<std::uint32_t>(count),
                         std::vector<std::uint32_t>(highest + 1)};
    auto heights = commands_.buffer<std::uint32_t>(count);
    commands_.run(program_["list_roots"], interior_count(), references_, heights_, places_,
                  interior_count(), least, heights, levels.nodes);
    radix_sort(commands_, heights, levels.nodes, count, int(std::bit_width(highest | 1U)));
    const auto begins = commands_.buffer<std::uint32_t>(levels.begins.size());
    commands_.run(program_["find_levels"], count, heights, count, begins);
    commands_.download(begins, std::span(levels.begins));
    levels.begins.push_back(count);
    return levels;
}

double TreeletPasses::total() {
    std::vector<double> sums(strands);
    commands_.download(sums_, std::span(sums));
    return std::accumulate(sums.begin(), sums.end(), 0.0);
}

double TreeletPasses::cost(const CostModel& model, double root_area) {
    if (root_area <= 0.0) return model.traversal;
    commands_.stage("tree cost");
    commands_.run(program_["sum_costs"], strands, bvh_.boxes, interior_count(), model.traversal,
                  model.intersection, strands, sums_);
    return total() / root_area;
}

/// Returns the area saved. Nodes are left as they are once time is out.
double TreeletPasses::pass(std::size_t gamma, const std::function<bool()>& out_of_time,
                           Token& token, Share share, const RestructureTreelets& restructure) {
    const TreeletLevels levels = find_levels(gamma);
    const std::uint32_t count = levels.begins.back(), most = most_queued(commands_);
    const auto savings = commands_.buffer<double>(count);
    commands_.fill(savings, 0.0);

    commands_.stage("treelets");
    std::uint32_t queued = 0;
    for (std::size_t level = 0; level + 1 < levels.begins.size(); ++level) {
        const std::uint32_t end = levels.begins[level + 1];
        for (std::uint32_t first = levels.begins[level]; first < end && !out_of_time();) {
            const std::uint32_t launched = std::min(end - first, most);
            restructure(levels.nodes, first, launched, savings);
            first += launched;
            queued += launched;
            if (queued < most) continue;
            commands_.finish();
            queued = 0;
            token.advance(std::lerp(share.begin, share.end, float(first) / float(count)));
        }
    }
    commands_.run(program_["sum_savings"], strands, savings, count, strands, sums_);
    const double saved = total();
    token.advance(share.end);
    return saved;
}

void TreeletPasses::run(const RestructuringLimits& limits, const CostModel& model,
                        const Stopwatch& watch, Token& token, BuildLog& log,
                        const RestructureTreelets& restructure) {
    const std::function<bool()> out_of_time = [&] {
        if (limits.max_seconds <= 0.0) return false;
        commands_.finish();  // what is in the queue takes time, too
        return watch.seconds() >= limits.max_seconds;
    };
    const double root_area = commands_.value(bvh_.boxes, 0).half_area();
    double tree_cost = cost(model, root_area);
    const auto report = [&](std::uint32_t iteration) {
        log.steps.push_back({iteration, watch.seconds(), tree_cost});
        token.report_cost(tree_cost);
    };
    report(0);

    std::size_t gamma = limits.treelet_size;
    float left = 1.0F;  // of the work: a pass has about half as many treelets as the one before
    log.ended = "converged";
    for (std::uint32_t iteration = 1; gamma <= bvh_.reference_count(); ++iteration) {
        if (iteration > limits.iterations) {
            log.ended = "iteration limit";
            break;
        }
        const double saved =
            pass(gamma, out_of_time, token, {1.0F - left, 1.0F - 0.5F * left}, restructure);
        if (root_area > 0.0) tree_cost -= model.traversal * saved / root_area;
        report(iteration);
        if (out_of_time()) {
            log.ended = "time limit";
            break;
        }
        gamma *= 2;
        left *= 0.5F;
    }
    token.advance(1.0F);
}

// --- lanes --------------------------------------------------------------------------------------

TreeletLanes::TreeletLanes(const Commands& commands, int treelet_size, std::size_t more_memory)
    : lanes(commands.suits_gpu && commands.work_group > 2
                ? std::min<std::size_t>(commands.work_group, 32)
                : 1),
      memory{96 * std::size_t(treelet_size) + more_memory} {}

std::string TreeletLanes::options(int treelet_size) const {
    return "-DTREELET_SIZE=" + std::to_string(treelet_size) +
           " -DLOCAL_BYTES=" + std::to_string(memory.bytes) + (lanes == 1 ? " -DONE_LANE" : "");
}

Range TreeletLanes::range(std::size_t treelets) const {
    return lanes == 1 ? Range(treelets) : Range(treelets * lanes, lanes);
}

}  // namespace bvhlab::opencl
