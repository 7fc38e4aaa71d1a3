// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/hlbvh.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "build/morton.h"
#include "opencl/lbvh.h"
#include "opencl/morton_order.h"
#include "opencl/range_boxes.h"
#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

constexpr std::uint32_t small_task = 16;  // clusters that one work-item divides by itself

// Types of hlbvh.cl.
struct Cluster {
    std::uint32_t size;
    std::uint8_t cell[4];
    Box box;
};
struct Task {
    std::uint32_t begin, count, node, leaf, references;
};
struct Place {
    std::uint32_t node, leaf;
};
struct Bin {
    std::int32_t lower[3], upper[3];
    std::uint32_t clusters;
};
struct Plane {
    double cost;
    std::int32_t axis, cell;
};
static_assert(sizeof(Cluster) == 32 && sizeof(Plane) == 16);

/// On a CPU a large task is for one work-item, which needs no atomics.
ProgramSource source(const Commands& commands) {
    return {{"range_boxes.cl", "lbvh.cl", "hlbvh.cl"},
            "-DSMALL=" + std::to_string(small_task) + (commands.suits_gpu ? "" : " -DALONE")};
}

/// The runs of codes with the same leading bits.
struct Clusters {
    std::uint32_t count = 0;
    Buffer<std::uint32_t> before;  ///< by place, and behind the last: clusters that begin before
    Buffer<std::uint32_t> firsts;  ///< by cluster, and behind the last: its first place

    Clusters(Commands& commands, Program& program, const Buffer<std::uint64_t>& codes, int bits) {
        const auto code_count = std::uint32_t(codes.size());
        before = commands.buffer<std::uint32_t>(codes.size() + 1);
        const auto total = commands.buffer<std::uint32_t>(1);
        commands.run(program["mark_clusters"], before.size(), codes, code_count,
                     std::uint32_t(morton_bits - bits), before);
        exclusive_scan(commands, before, before.size(), total);
        count = commands.value(before, code_count);
        firsts = commands.buffer<std::uint32_t>(count + 1);
        commands.run(program["list_clusters"], before.size(), before, code_count, firsts);
    }
};

/// Divides the clusters level by level.
class TopLevels {
public:
    TopLevels(Commands& commands, Program& program, const DeviceMortonOrder& order,
              const Clusters& clusters, const HlbvhConfig& config, const DeviceBinary& bvh)
        : commands_(commands),
          program_(program),
          bvh_(bvh),
          cells_(1U << unsigned(config.sah_bits + 2) / 3),
          clusters_(commands.buffer<Cluster>(clusters.count)),
          order_(commands.buffer<std::uint32_t>(clusters.count)),
          next_order_(commands.buffer<std::uint32_t>(clusters.count)),
          small_{commands.buffer<Task>(clusters.count - 1)},
          large_{commands.buffer<Task>(clusters.count - 1)},
          counts_(commands.buffer<std::uint32_t>(2)),
          places_(commands.buffer<Place>(clusters.count)) {
        const std::size_t count = order.codes.size();
        const auto boxes = commands.buffer<Box>(count);
        place_leaf_boxes(commands, order.boxes, order.references, 0, boxes);
        const Buffer<Box> levels = range_box_levels(commands, boxes, 0, count);
        commands.run(program["make_clusters"], clusters.count, clusters.firsts, clusters.count,
                     order.codes, std::uint32_t(morton_bits), std::uint32_t(config.sah_bits), boxes,
                     std::uint32_t(count), levels, clusters_, order_);
    }

    /// Writes the children of nodes above the clusters. Returns by cluster where its subtree goes.
    const Buffer<Place>& run() {
        begin();
        while (small_.done < small_.count || large_.done < large_.count) {
            const std::uint32_t small_count = small_.count - small_.done;
            const std::uint32_t large_count = large_.count - large_.done;
            split_large(large_count);
            commands_.run(program_["split_small"], small_count, small_.tasks, small_.done,
                          small_count, large_.tasks, counts_, clusters_, order_, next_order_,
                          places_, bvh_.children, bvh_.first_leaf());
            std::swap(order_, next_order_);
            std::array<std::uint32_t, 2> counts{};
            commands_.download(counts_, std::span<std::uint32_t>(counts));
            small_.done = std::exchange(small_.count, counts[0]);
            large_.done = std::exchange(large_.count, counts[1]);
        }
        return places_;
    }

    /// Writes their boxes; those of leaves and the levels above them must be there.
    void place_boxes(const Buffer<Box>& levels) {
        for (const Queue* queue : {&small_, &large_})
            commands_.run(program_["top_boxes"], queue->count, queue->tasks, queue->count,
                          std::uint32_t(bvh_.reference_count()), levels, bvh_.boxes);
    }

private:
    /// Tasks of all levels so far, of which the first `done` are of earlier ones.
    struct Queue {
        Buffer<Task> tasks;
        std::uint32_t done = 0, count = 0;
    };

    void begin() {
        const auto count = std::uint32_t(clusters_.size());
        if (count == 1) {
            const Place root{0, 0};
            commands_.upload(std::span(&root, 1), places_);
            return;
        }
        Queue& queue = count <= small_task ? small_ : large_;
        const Task root{0, count, 0, 0, std::uint32_t(bvh_.reference_count())};
        commands_.upload(std::span(&root, 1), queue.tasks);
        queue.count = 1;
        const std::array<std::uint32_t, 2> counts{small_.count, large_.count};
        commands_.upload(std::span<const std::uint32_t>(counts), counts_);
    }

    void split_large(std::uint32_t count) {
        Kernel& kernel = program_["split_large"];
        const std::size_t group =
            commands_.suits_gpu ? std::min(commands_.work_group, kernel.largest_group) : 1;
        commands_.run(kernel, Range(count * group, group), large_.tasks, large_.done, small_.tasks,
                      counts_, clusters_, order_, next_order_, places_, bvh_.children,
                      bvh_.first_leaf(), cells_, Local{3 * cells_ * sizeof(Bin)},
                      Local{3 * cells_ * sizeof(double)}, Local{3 * sizeof(Plane)},
                      Local{3 * sizeof(std::uint32_t)});
    }

    Commands& commands_;
    Program& program_;
    const DeviceBinary& bvh_;
    std::uint32_t cells_;  // of the grid, per axis
    Buffer<Cluster> clusters_;
    Buffer<std::uint32_t> order_, next_order_;
    Queue small_, large_;
    Buffer<std::uint32_t> counts_;
    Buffer<Place> places_;
};

}  // namespace

DeviceBinary build_hlbvh(Commands& commands, const DeviceMesh& mesh, const HlbvhConfig& config,
                         Token& token) {
    token.begin("building HLBVH");
    const std::size_t count = mesh.size();
    const DeviceMortonOrder order = morton_order(commands, mesh);
    const RadixTree tree = radix_tree(commands, order.codes);
    DeviceBinary bvh = DeviceBinary::with_references(commands, count);

    commands.stage("top levels");
    Program program(commands.device(), source(commands));
    const Clusters clusters(commands, program, order.codes, config.sah_bits);
    token.advance(0.6F);
    TopLevels top(commands, program, order, clusters, config, bvh);
    const Buffer<Place>& places = top.run();
    token.advance(0.8F);

    commands.stage("boxes");
    commands.run(program["place_references"], count, clusters.before, clusters.firsts, places,
                 order.references, std::uint32_t(count), bvh.references);
    place_leaf_boxes(commands, order.boxes, bvh.references, bvh.first_leaf(), bvh.boxes);
    const Buffer<Box> levels = range_box_levels(commands, bvh.boxes, bvh.first_leaf(), count);
    top.place_boxes(levels);
    const auto roots = commands.buffer<std::uint32_t>(clusters.count);
    commands.run(program["find_roots"], count - 1, tree.nodes, tree.numbers,
                 std::uint32_t(count - 1), clusters.before, clusters.firsts, roots);
    commands.run(program["cluster_nodes"], count - 1, tree.nodes, tree.numbers,
                 std::uint32_t(count), clusters.before, clusters.firsts, roots, places, levels,
                 bvh.children, bvh.boxes);
    commands.finish();
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab::opencl
