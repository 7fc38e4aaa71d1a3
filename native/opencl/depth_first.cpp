// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/depth_first.h"

#include <cstdint>
#include <utility>

namespace bvhlab::opencl {
namespace {

/// Jump of depth_first.cl.
struct Jump {
    std::uint32_t upper, nodes, leaves;
};

/// Leaves below each interior node.
Buffer<std::uint32_t> count_leaves(Commands& commands, Program& program, const DeviceBinary& bvh) {
    const std::uint32_t count = bvh.first_leaf();
    const auto parents = commands.buffer<std::uint32_t>(bvh.boxes.size());
    auto leaves = commands.buffer<std::uint32_t>(count);
    commands.run(program["link_parents"], count, bvh.children, count, parents);
    commands.fill(leaves, 0U);
    commands.run(program["count_leaves"], bvh.reference_count(), parents, count, leaves);
    return leaves;
}

/// From each interior node to the root.
Buffer<Jump> jumps_to_root(Commands& commands, Program& program, const DeviceBinary& bvh,
                           const Buffer<std::uint32_t>& leaves) {
    const std::uint32_t count = bvh.first_leaf();
    auto jumps = commands.buffer<Jump>(count), doubled = commands.buffer<Jump>(count);
    const auto unfinished = commands.buffer<std::uint32_t>(1);
    commands.run(program["first_jumps"], count, bvh.children, count, leaves, jumps);
    do {
        commands.fill(unfinished, 0U);
        commands.run(program["double_jumps"], count, jumps, count, doubled, unfinished,
                     Local{sizeof(std::uint32_t)});
        std::swap(jumps, doubled);
    } while (commands.value(unfinished, 0) != 0);
    return jumps;
}

}  // namespace

DeviceBinary depth_first(Commands& commands, const DeviceBinary& bvh) {
    const std::uint32_t count = bvh.first_leaf();
    DeviceBinary ordered = DeviceBinary::with_references(commands, bvh.reference_count());
    if (count == 0) {
        commands.copy(bvh.boxes, ordered.boxes, 1);
        commands.copy(bvh.references, ordered.references, 1);
        return ordered;
    }
    Program program(commands.device(), {{"depth_first.cl"}, ""});
    const Buffer<std::uint32_t> leaves = count_leaves(commands, program, bvh);
    const Buffer<Jump> jumps = jumps_to_root(commands, program, bvh, leaves);
    commands.run(program["place_nodes"], count, bvh.children, bvh.boxes, bvh.references, count,
                 leaves, jumps, ordered.children, ordered.boxes, ordered.references);
    return ordered;
}

}  // namespace bvhlab::opencl
