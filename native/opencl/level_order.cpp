// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/level_order.h"

#include <utility>

#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

/// Opens all levels of a planned tree.
class Levels {
public:
    Levels(Commands& commands, Program& program, const DeviceBinary& binary, Plans& plans,
           LevelOrder& order)
        : commands_(commands),
          program_(program),
          binary_(binary),
          plans_(plans),
          order_(order),
          roots_(commands.buffer<std::uint32_t>(most_nodes())),
          interior_(commands.buffer<std::uint32_t>(most_nodes())),
          state_(commands.buffer<std::uint32_t>(3)) {
        order_.first_child = commands.buffer<std::uint32_t>(most_nodes());
        order_.blocks = commands.buffer<std::uint32_t>(most_nodes());
        commands.fill(roots_, 0U);  // the first is the root
    }

    /// Returns the number of levels.
    std::size_t open_all() {
        Kernel& narrow = program_["open_narrow_levels"];
        const std::size_t group = std::min(commands_.work_group, narrow.largest_group);
        while (count_ > 0) {
            if (count_ <= group)
                open_narrow(narrow, group);
            else
                open_wide();
        }
        order_.node_count = first_;
        return levels_;
    }

private:
    /// Each wide node stands for an interior node of the binary tree, but that of a single leaf.
    std::size_t most_nodes() const { return std::max<std::size_t>(1, binary_.first_leaf()); }

    void open_narrow(Kernel& kernel, std::size_t group) {
        constexpr std::uint32_t most_levels = 1024;
        commands_.run(kernel, Range(group, group), binary_.children, plans_.nodes, binary_.boxes,
                      binary_.first_leaf(), first_, count_, most_levels, roots_, plans_.work,
                      order_.blocks, order_.first_child, state_,
                      Local{group * sizeof(std::uint32_t)});
        std::uint32_t state[3];
        commands_.download(state_, std::span<std::uint32_t>(state));
        first_ = state[0];
        count_ = state[1];
        levels_ += state[2];
    }

    void open_wide() {
        in_parts(count_, [&](std::uint32_t start, std::uint32_t part) {
            commands_.run(program_["open_level"], part, binary_.children, plans_.nodes,
                          binary_.boxes, binary_.first_leaf(), first_, count_, start, roots_,
                          plans_.work, order_.blocks, interior_);
        });
        exclusive_scan(commands_, interior_, count_, state_);
        in_parts(count_, [&](std::uint32_t start, std::uint32_t part) {
            commands_.run(program_["number_level"], part, first_, count_, start, interior_,
                          plans_.work, order_.first_child, roots_);
        });
        first_ += count_;
        count_ = commands_.value(state_, 0);
        ++levels_;
    }

    Commands& commands_;
    Program& program_;
    const DeviceBinary& binary_;
    Plans& plans_;
    LevelOrder& order_;
    Buffer<std::uint32_t> roots_, interior_, state_;
    std::uint32_t first_ = 0, count_ = 1;  ///< wide nodes of the level that comes next
    std::size_t levels_ = 0;
};

/// Finds the leaves' blocks and lists their references; sets the counts of `bvh`.
void list_references(Commands& commands, Program& program, const DeviceBinary& binary,
                     const Plans& plans, LevelOrder& order, Bvh& bvh) {
    const auto total = commands.buffer<std::uint32_t>(1);
    const auto leaf_count = commands.buffer<std::uint32_t>(1);
    const auto largest_leaf = commands.buffer<std::uint32_t>(1);
    commands.fill(leaf_count, 0U);
    commands.fill(largest_leaf, 0U);
    exclusive_scan(commands, order.blocks, order.node_count, total);
    order.block_count = commands.value(total, 0);
    const auto heads = commands.buffer<std::uint64_t>(order.block_count);
    commands.fill(heads, ~std::uint64_t(0));
    in_parts(order.node_count, [&](std::uint32_t start, std::uint32_t part) {
        commands.run(program["find_leaves"], part, plans.nodes, binary.first_leaf(),
                     order.node_count, start, order.opened, order.blocks, heads, leaf_count,
                     largest_leaf);
    });
    order.lanes = commands.buffer<std::uint32_t>(std::size_t(order.block_count) * plans.lanes());
    in_parts(order.block_count, [&](std::uint32_t start, std::uint32_t part) {
        commands.run(program["list_references"], part, binary.children, plans.nodes, plans.parents,
                     binary.references, binary.first_leaf(), heads, order.block_count, start,
                     order.lanes);
    });
    bvh.leaf_count = commands.value(leaf_count, 0);
    bvh.max_leaf_size = commands.value(largest_leaf, 0);
}

}  // namespace

Plans::Plans(Commands& commands, const DeviceBinary& binary, unsigned branching_, bool compressed_)
    : branching(branching_),
      compressed(compressed_),
      nodes(commands.buffer<std::uint64_t>(binary.first_leaf())),
      parents(commands.buffer<std::uint32_t>(binary.boxes.size())),
      work(commands.buffer<std::uint32_t>(branching *
                                          std::max<std::size_t>(1, binary.first_leaf()))) {}

std::string Plans::options() const {
    return "-DWIDTH=" + std::to_string(branching) + " -DLANES=" + std::to_string(lanes()) +
           (compressed ? " -DCOMPRESSED" : "");
}

LevelOrder level_order(Commands& commands, Program& program, const DeviceBinary& binary,
                       Plans& plans, Bvh& bvh) {
    LevelOrder order;
    bvh.max_depth = Levels(commands, program, binary, plans, order).open_all();
    order.opened = std::move(plans.work);
    bvh.reference_count = binary.reference_count();
    list_references(commands, program, binary, plans, order, bvh);
    return order;
}

}  // namespace bvhlab::opencl
