// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/trbvh.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <vector>

#include "opencl/depth_first.h"
#include "opencl/lbvh.h"
#include "opencl/treelet.h"

namespace bvhlab::opencl {
namespace {

/// SetOrder of trbvh.cl: where the sets of so many of `size` leaves begin, for 0 .. size + 1, then
/// all sets, those of fewer leaves first.
std::vector<std::uint32_t> set_order(unsigned size) {
    std::vector<std::uint32_t> order(size + 2), sets(std::size_t(1) << size);
    std::iota(sets.begin(), sets.end(), 0U);
    std::ranges::stable_sort(sets, {}, [](std::uint32_t set) { return std::popcount(set); });
    for (const std::uint32_t set : sets) ++order[unsigned(std::popcount(set)) + 1];
    std::partial_sum(order.begin(), order.end(), order.begin());
    order.insert(order.end(), sets.begin(), sets.end());
    return order;
}

}  // namespace

void restructure(Commands& commands, DeviceBinary& bvh, const CostModel& model,
                 const TrbvhConfig& config, const Stopwatch& watch, Token& token, BuildLog& log) {
    const std::size_t sets_bytes = std::size_t(40) << config.treelet_size;
    const TreeletLanes lanes(commands, config.treelet_size, sets_bytes);
    TreeletPasses passes(commands, bvh);
    Program program(commands.device(),
                    {{"treelet.cl", "trbvh.cl"}, lanes.options(config.treelet_size)});
    const std::vector<std::uint32_t> host_order = set_order(unsigned(config.treelet_size));
    const auto order = commands.upload(std::span(host_order));
    const auto costs = commands.buffer<double>(bvh.children.size());

    if (bvh.first_leaf() != 0) {
        const TreeletLevels all = passes.find_levels(2);
        commands.stage("node costs");
        for (std::size_t level = 0; level + 1 < all.begins.size(); ++level)
            commands.run(program["update_costs"], all.begins[level + 1] - all.begins[level],
                         bvh.boxes, bvh.children, passes.references(), bvh.first_leaf(), all.nodes,
                         all.begins[level], all.begins[level + 1], model, costs);
    }
    const RestructureTreelets optimise = [&](const Buffer<std::uint32_t>& nodes,
                                             std::uint32_t first, std::uint32_t count,
                                             const Buffer<double>& savings) {
        commands.run(program["optimise_treelets"], lanes.range(count), bvh.boxes, bvh.children,
                     passes.references(), bvh.first_leaf(), nodes, first, first + count, model,
                     order, costs, savings, lanes.memory);
    };
    const RestructuringLimits limits{.treelet_size = std::uint32_t(config.treelet_size),
                                     .iterations = std::uint32_t(config.iterations),
                                     .max_seconds = config.max_seconds};
    passes.run(limits, model, watch, token, log, optimise);
}

DeviceBinary build_trbvh(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                         const TrbvhConfig& config, Token& token, BuildLog& log) {
    token.begin("building TRBVH");
    const Stopwatch watch;
    Token base_token(&token);
    DeviceBinary bvh = build_lbvh(commands, mesh, base_token);
    restructure(commands, bvh, model, config, watch, token, log);
    commands.stage("depth-first order");
    return depth_first(commands, bvh);
}

}  // namespace bvhlab::opencl
