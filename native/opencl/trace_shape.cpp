// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/trace_shape.h"

namespace bvhlab::opencl {
namespace {

/// Stack entries of a ray in private memory: far more than rays need in trees of real scenes. A CPU
/// has one stack for each core, a GPU one for each of many thousands of threads.
constexpr std::size_t stack_on_cpu = 256;
constexpr std::size_t stack_on_gpu = 128;
/// Of traverse_octant.cl, one for each level at most.
constexpr std::size_t octant_stack = 48;

/// Of traverse_lanes.cl. Such a group takes less than 6 KiB of local memory.
constexpr std::size_t lanes_group = 32;
constexpr std::size_t lanes_stack_of_4 = 48;
constexpr std::size_t lanes_stack_of_8 = 96;

std::string define(const char* name, std::size_t value) {
    return std::string(" -D") + name + "=" + std::to_string(value);
}

bool is_compressed(const DeviceTree& tree) {
    return tree.layout == NodeLayout::cwbvh;
}

/// Files and options that all kernels for a tree have in common. `lanes`: triangles that go through
/// the float filter at once.
ProgramSource common_source(const DeviceTree& tree, std::size_t lanes, std::size_t stack,
                            bool careful) {
    ProgramSource source{{"ray.cl", "boxes.cl"}, ""};
    if (careful) source.files.push_back("exact.cl");
    source.files.push_back("intersect.cl");
    source.files.push_back(is_compressed(tree) ? "traverse_compressed_nodes.cl"
                                               : "traverse_full_nodes.cl");
    source.files.push_back("traverse_ray.cl");
    source.options = define("WIDTH", tree.branching) + define("BLOCK", tree.block) +
                     define("LANES", lanes) + define("STACK_SIZE", stack);
    return source;
}

std::size_t private_stack(bool suits_gpu) {
    return suits_gpu ? stack_on_gpu : stack_on_cpu;
}

/// A thread of a CPU has vectors of its own, one of a GPU is a lane of a vector.
std::size_t filter_lanes(bool suits_gpu, const DeviceTree& tree) {
    return suits_gpu ? 1 : tree.block;
}

}  // namespace

std::vector<TraceShape> shapes_for(const DeviceTree& tree) {
    if (is_compressed(tree)) return {TraceShape::single, TraceShape::octant};
    return {TraceShape::single, tree.branching == 2 ? TraceShape::persistent : TraceShape::lanes};
}

TraceKernel kernel_of(bool suits_gpu, const DeviceTree& tree, TraceShape shape, bool any_hit) {
    const std::size_t stack = private_stack(suits_gpu);
    ProgramSource source = common_source(
        tree, shape == TraceShape::lanes ? 1 : filter_lanes(suits_gpu, tree), stack, false);
    source.options += define("ANY_HIT", any_hit);
    const auto kernel = [&](const char* file, const char* name) {
        source.files.push_back(file);
        return TraceKernel{source, name, 0, 1, false, stack};
    };
    if (shape == TraceShape::octant) {
        source.options += define("OCTANT_STACK", octant_stack);
        return kernel("traverse_octant.cl", "traverse_octant");
    }
    if (shape == TraceShape::persistent) {
        TraceKernel persistent = kernel("traverse_persistent.cl", "traverse_persistent");
        persistent.fetches = true;
        return persistent;
    }
    if (shape == TraceShape::lanes) {
        const std::size_t team_stack = tree.branching == 4 ? lanes_stack_of_4 : lanes_stack_of_8;
        source.options += define("GROUP", lanes_group) + define("TEAM_STACK", team_stack);
        source.files.push_back("traverse_lanes.cl");
        return {source, "traverse_lanes", lanes_group, tree.branching, true, team_stack};
    }
    return kernel("traverse_single.cl", "traverse");
}

TraceKernel careful_kernel_of(bool suits_gpu, const DeviceTree& tree) {
    const std::size_t stack = private_stack(suits_gpu);
    ProgramSource source = common_source(tree, filter_lanes(suits_gpu, tree), stack, true);
    source.files.push_back("traverse_careful.cl");
    source.options += " -DCAREFUL";
    return {source, "traverse_carefully", 0, 1, false, stack};
}

}  // namespace bvhlab::opencl
