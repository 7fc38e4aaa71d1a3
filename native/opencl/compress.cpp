// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/compress.h"

#include <algorithm>
#include <utility>

namespace bvhlab::opencl {

Bvh compressed_layout(Commands& commands, const DeviceBinary& binary, Plans plans,
                      const DeviceMesh& mesh) {
    commands.stage("layout");
    Bvh bvh;
    Program program(commands.device(), {{"level_order.cl", "compress.cl"}, plans.options()});
    const LevelOrder order = level_order(commands, program, binary, plans, bvh);

    const auto nodes = commands.buffer<CompressedNode>(order.node_count);
    in_parts(order.node_count, [&](std::uint32_t start, std::uint32_t part) {
        commands.run(program["fill_compressed_nodes"], part, binary.boxes, plans.nodes,
                     binary.first_leaf(), order.node_count, start, order.opened, order.first_child,
                     order.blocks, nodes);
    });
    const std::uint32_t references = order.block_count;
    const auto corners = commands.buffer<float>(CompressedBvh::corner_floats * references);
    in_parts(references, [&](std::uint32_t start, std::uint32_t part) {
        commands.run(program["fill_corners"], part, mesh.vertices, mesh.triangles, references,
                     start, order.lanes, corners);
    });

    auto& tree = bvh.tree.emplace<CompressedBvh>();
    tree.nodes.resize(order.node_count);
    tree.triangles.resize(references);
    tree.corners.resize(corners.size() + CompressedBvh::corner_padding);
    std::fill_n(tree.corners.end() - CompressedBvh::corner_padding, CompressedBvh::corner_padding,
                0.0F);
    commands.download(nodes, std::span(tree.nodes));
    commands.download(order.lanes, std::span(tree.triangles));
    commands.download(corners, std::span(tree.corners).first(corners.size()));
    return bvh;
}

}  // namespace bvhlab::opencl
