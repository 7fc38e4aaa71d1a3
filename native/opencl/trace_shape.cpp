// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/trace_shape.h"

#include <algorithm>

namespace bvhlab::opencl {
namespace {

/// Stack entries of a ray in private memory: far more than rays need in trees of real scenes. A CPU
/// has one stack for each core, a GPU one for each of many thousands of threads.
constexpr std::size_t stack_on_cpu = 256;
constexpr std::size_t stack_on_gpu = 128;
/// Of traverse_octant.cl, one for each level at most.
constexpr std::size_t octant_stack = 48;

/// Of traverse_lanes.cl; entries in local memory. Such a group takes less than 6 KiB of it.
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

/// Bits of a ballot.
constexpr std::size_t largest_sub_group = 128;

/// Whether a kernel may talk by sub-groups: teams of `team` threads must not span two of them, and
/// groups must be made of whole ones, unless each thread is a team.
bool has_sub_groups_for(Commands& commands, ProgramSource source, const char* name,
                        std::size_t group, std::size_t team) {
    if (!commands.use_sub_groups) return false;
    source.sub_groups = true;
    Program program(commands.device(), source);
    const Kernel& kernel = program[name];
    const std::size_t used = std::min(group ? group : commands.work_group, kernel.largest_group);
    const std::size_t size = commands.device().sub_group_size(kernel.handle.get(), used);
    return size != 0 && size <= largest_sub_group &&
           (team == 1 || (size % team == 0 && used % size == 0));
}

}  // namespace

std::vector<TraceShape> shapes_for(const DeviceTree& tree) {
    if (is_compressed(tree)) return {TraceShape::single, TraceShape::octant};
    return {TraceShape::single, tree.branching == 2 ? TraceShape::persistent : TraceShape::lanes};
}

TraceKernel kernel_of(Commands& commands, const DeviceTree& tree, TraceShape shape, bool any_hit) {
    const bool suits_gpu = commands.suits_gpu;
    const std::size_t stack = private_stack(suits_gpu);
    ProgramSource source = common_source(
        tree, shape == TraceShape::lanes ? 1 : filter_lanes(suits_gpu, tree), stack, false);
    source.options += define("ANY_HIT", any_hit);
    const auto kernel = [&](const char* file, const char* name) {
        source.files.push_back(file);
        return TraceKernel{source, name, 0, 1, false, stack};
    };
    const auto fetching = [&](const char* file, const char* name, std::size_t group, unsigned team,
                              std::size_t entries) {
        source.options += define("TEAM", team);
        source.files.insert(source.files.end(), {"team.cl", file});
        source.sub_groups = has_sub_groups_for(commands, source, name, group, team);
        return TraceKernel{source, name, group, team, true, entries};
    };
    if (shape == TraceShape::octant) {
        source.options += define("OCTANT_STACK", octant_stack);
        return kernel("traverse_octant.cl", "traverse_octant");
    }
    if (shape == TraceShape::persistent)
        return fetching("traverse_persistent.cl", "traverse_persistent", 0, 1, stack);
    if (shape == TraceShape::lanes) {
        const std::size_t team_stack = tree.branching == 4 ? lanes_stack_of_4 : lanes_stack_of_8;
        source.options += define("GROUP", lanes_group);
        return fetching("traverse_lanes.cl", "traverse_lanes", lanes_group, tree.branching,
                        std::min(team_stack, tree.stack_size));
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
