// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/lbvh.h"

#include <utility>

#include "opencl/morton_order.h"
#include "opencl/range_boxes.h"
#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

ProgramSource source() {
    return {{"range_boxes.cl", "lbvh.cl"}, ""};
}

}  // namespace

RadixTree radix_tree(Commands& commands, const Buffer<std::uint64_t>& codes) {
    const std::size_t count = codes.size() - 1;
    RadixTree tree{commands.buffer<RadixTree::Node>(count), commands.buffer<std::uint32_t>(count)};
    const auto starts = commands.buffer<std::uint32_t>(count);
    const auto total = commands.buffer<std::uint32_t>(1);
    Program program(commands.device(), source());
    commands.stage("hierarchy");
    commands.run(program["radix_tree"], count, codes, std::uint32_t(codes.size()), tree.nodes);
    commands.run(program["chain_lengths"], count, tree.nodes, std::uint32_t(count), starts);
    exclusive_scan(commands, starts, count, total);
    commands.run(program["number_chains"], count, tree.nodes, std::uint32_t(count), starts,
                 tree.numbers);
    return tree;
}

DeviceBinary build_lbvh(Commands& commands, const DeviceMesh& mesh, Token& token) {
    token.begin("building LBVH");
    DeviceMortonOrder order = morton_order(commands, mesh);
    const std::size_t count = mesh.size();
    DeviceBinary bvh = DeviceBinary::with_references(commands, count);
    bvh.references = std::move(order.references);
    const RadixTree tree = radix_tree(commands, order.codes);

    commands.stage("boxes");
    place_leaf_boxes(commands, order.boxes, bvh.references, bvh.first_leaf(), bvh.boxes);
    const Buffer<Box> levels = range_box_levels(commands, bvh.boxes, bvh.first_leaf(), count);
    Program program(commands.device(), source());
    commands.run(program["lbvh_nodes"], count - 1, tree.nodes, tree.numbers, std::uint32_t(count),
                 levels, bvh.children, bvh.boxes);
    commands.finish();
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab::opencl
