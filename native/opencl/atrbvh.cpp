// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/atrbvh.h"

#include "opencl/depth_first.h"
#include "opencl/lbvh.h"
#include "opencl/treelet.h"

namespace bvhlab::opencl {

void restructure(Commands& commands, DeviceBinary& bvh, const CostModel& model,
                 const AtrbvhConfig& config, const Stopwatch& watch, Token& token, BuildLog& log) {
    const std::size_t clusters_bytes = 36 * std::size_t(config.treelet_size + 7);
    const TreeletLanes lanes(commands, config.treelet_size, clusters_bytes);
    TreeletPasses passes(commands, bvh);
    Program program(commands.device(),
                    {{"treelet.cl", "atrbvh.cl"}, lanes.options(config.treelet_size)});
    const RestructureTreelets agglomerate = [&](const Buffer<std::uint32_t>& nodes,
                                                std::uint32_t first, std::uint32_t count,
                                                const Buffer<double>& savings) {
        commands.run(program["agglomerate_treelets"], lanes.range(count), bvh.boxes, bvh.children,
                     passes.references(), bvh.first_leaf(), nodes, first, first + count, savings,
                     lanes.memory);
    };
    const RestructuringLimits limits{.treelet_size = std::uint32_t(config.treelet_size),
                                     .iterations = std::uint32_t(config.iterations),
                                     .max_seconds = config.max_seconds};
    passes.run(limits, model, watch, token, log, agglomerate);
}

DeviceBinary build_atrbvh(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                          const AtrbvhConfig& config, Token& token, BuildLog& log) {
    token.begin("building ATRBVH");
    const Stopwatch watch;
    Token base_token(&token);
    DeviceBinary bvh = build_lbvh(commands, mesh, base_token);
    restructure(commands, bvh, model, config, watch, token, log);
    commands.stage("depth-first order");
    return depth_first(commands, bvh);
}

}  // namespace bvhlab::opencl
