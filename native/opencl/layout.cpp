// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/layout.h"

#include <utility>

namespace bvhlab::opencl {
namespace {

template <unsigned K>
void lay_out(Commands& commands, const DeviceBinary& binary, Plans& plans, const DeviceMesh& mesh,
             Bvh& bvh) {
    using Block = TriangleBlock<block_lanes<K>>;
    static_assert(sizeof(WideNode<K>) == 8 * K * sizeof(float));
    static_assert(sizeof(Block) == 10 * block_lanes<K> * sizeof(float));
    Program program(commands.device(), {{"level_order.cl", "layout.cl"}, plans.options()});
    const LevelOrder order = level_order(commands, program, binary, plans, bvh);

    const auto nodes = commands.buffer<WideNode<K>>(order.node_count);
    in_parts(order.node_count, [&](std::uint32_t start, std::uint32_t part) {
        commands.run(program["fill_nodes"], part, binary.boxes, plans.nodes, binary.first_leaf(),
                     order.node_count, start, order.opened, order.first_child, order.blocks, nodes);
    });
    const auto blocks = commands.buffer<Block>(order.block_count);
    const std::uint64_t lanes = order.lanes.size();
    in_parts(lanes, [&](std::uint64_t start, std::uint64_t part) {
        commands.run(program["fill_blocks"], part, mesh.vertices, mesh.triangles, order.lanes,
                     lanes, start, blocks);
    });

    auto& wide = bvh.tree.emplace<WideBvh<K>>();
    wide.nodes.resize(order.node_count);
    wide.blocks.resize(order.block_count);
    commands.download(nodes, std::span(wide.nodes));
    commands.download(blocks, std::span(wide.blocks));
}

}  // namespace

Bvh breadth_first_layout(Commands& commands, const DeviceBinary& binary, Plans plans,
                         const DeviceMesh& mesh) {
    commands.stage("layout");
    Bvh bvh;
    switch (plans.branching) {
        case 2:
            lay_out<2>(commands, binary, plans, mesh, bvh);
            break;
        case 4:
            lay_out<4>(commands, binary, plans, mesh, bvh);
            break;
        default:
            lay_out<8>(commands, binary, plans, mesh, bvh);
    }
    return bvh;
}

}  // namespace bvhlab::opencl
