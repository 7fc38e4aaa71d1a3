// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/ploc.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "opencl/depth_first.h"
#include "opencl/morton_order.h"
#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

// As in build/ploc.cpp.
constexpr double stalled_share = 1.0 / 64.0;
constexpr std::uint32_t longest_stalled_row = 256;

/// Floats that find_nearest_by_lanes may read past a row's end: LANES of ploc.cl.
constexpr std::size_t padding = 16;

/// Candidates looked at in one launch, so that none takes long.
constexpr std::size_t most_candidates = std::size_t(1) << 27;

/// UnitScale of build/ploc.cpp.
double unit_scale(const Box& scene) {
    double longest = 0.0;
    for (int axis = 0; axis < 3; ++axis)
        longest = std::max(longest, double(scene.upper[axis]) - double(scene.lower[axis]));
    return longest > 0.0 ? std::ldexp(1.0, -std::ilogb(longest)) : 1.0;
}

/// The roots of the subtrees built so far: boxes by face, and nodes.
struct Row {
    Buffer<float> boxes;
    Buffer<std::uint32_t> nodes;

    Row(Commands& commands, std::size_t count)
        : boxes(commands.buffer<float>(6 * count)), nodes(commands.buffer<std::uint32_t>(count)) {}
};

class Agglomeration {
public:
    Agglomeration(Commands& commands, const DeviceMesh& mesh)
        : commands_(commands),
          program_(commands.device(), {{"ploc.cl"}, ""}),
          scan_(commands),
          stride_(std::uint32_t(mesh.size() + padding)),
          count_(std::uint32_t(mesh.size())),
          bvh_(DeviceBinary::with_references(commands, count_)),
          row_(commands, stride_),
          next_row_(commands, stride_),
          nearest_(commands.buffer<std::uint32_t>(count_)),
          partners_(commands.buffer<std::uint32_t>(count_)),
          goes_(commands.buffer<std::uint32_t>(count_)),
          total_(commands.buffer<std::uint32_t>(1)) {
        DeviceMortonOrder order = morton_order(commands, mesh);
        bvh_.references = std::move(order.references);
        commands.stage("merging");
        place_leaf_boxes(commands, order.boxes, bvh_.references, bvh_.first_leaf(), bvh_.boxes);
        commands.run(program_["first_row"], count_, bvh_.boxes, bvh_.first_leaf(), count_,
                     unit_scale(mesh.bounds), stride_, row_.boxes, row_.nodes);
    }

    DeviceBinary run(const PlocConfig& config, Token& token) {
        const double most = config.radius;
        double radius = std::min(double(config.first_radius), most);
        while (count_ > 1) {
            token.advance(0.9F - 0.6F * float(count_) / float(stride_));
            find_nearest(std::uint32_t(radius));
            merge();
            radius = std::min(radius * config.growth, most);
        }
        return std::move(bvh_);
    }

private:
    void find_nearest(std::uint32_t radius) {
        commands_.stage("neighbours");
        const std::size_t step = most_candidates / (2 * radius) / 1024 * 1024;
        for (std::size_t begin = 0; begin < count_; begin += step)
            find_nearest(radius, std::uint32_t(begin),
                         std::uint32_t(std::min<std::size_t>(count_, begin + step)));
    }

    void find_nearest(std::uint32_t radius, std::uint32_t begin, std::uint32_t end) {
        const std::uint32_t items = end - begin;
        if (!commands_.suits_gpu) {
            commands_.run(program_["find_nearest_by_lanes"], items, row_.boxes, stride_, count_,
                          begin, end, radius, nearest_);
            return;
        }
        Kernel& kernel = program_["find_nearest"];
        const std::size_t box_bytes = 6 * sizeof(float);
        const std::size_t fitting =
            std::size_t(commands_.device().info().local_memory) / box_bytes - 2 * radius;
        const std::size_t group = std::min({commands_.work_group, kernel.largest_group, fitting});
        commands_.run(kernel, Range(items, group), row_.boxes, stride_, count_, begin, end, radius,
                      nearest_, Local{box_bytes * (group + 2 * radius)});
    }

    void merge() {
        commands_.stage("merging");
        std::uint32_t pairs = find_pairs(false);
        if (count_ > longest_stalled_row && pairs < stalled_share * count_)
            pairs = find_pairs(true);
        const std::uint32_t next_count = count_ - pairs;
        commands_.run(program_["merge_clusters"], count_, partners_, goes_, count_, next_count,
                      stride_, row_.boxes, row_.nodes, next_row_.boxes, next_row_.nodes, bvh_.boxes,
                      bvh_.children);
        std::swap(row_, next_row_);
        count_ = next_count;
    }

    /// Returns how many there are.
    std::uint32_t find_pairs(bool stalled) {
        commands_.run(program_["find_partners"], count_, nearest_, count_, std::uint32_t(stalled),
                      partners_, goes_);
        scan_(goes_, count_, total_);
        return commands_.value(total_, 0);
    }

    Commands& commands_;
    Program program_;
    Scan scan_;
    std::uint32_t stride_;  // of the rows
    std::uint32_t count_;   // clusters in the row
    DeviceBinary bvh_;
    Row row_, next_row_;
    Buffer<std::uint32_t> nearest_, partners_, goes_, total_;
};

}  // namespace

DeviceBinary build_ploc(Commands& commands, const DeviceMesh& mesh, const PlocConfig& config,
                        Token& token) {
    token.begin("building PLOC");
    const DeviceBinary bvh = Agglomeration(commands, mesh).run(config, token);
    commands.stage("order");
    DeviceBinary ordered = depth_first(commands, bvh);
    commands.finish();
    token.advance(1.0F);
    return ordered;
}

}  // namespace bvhlab::opencl
