// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/collapse.h"

#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "opencl/compress.h"
#include "opencl/layout.h"
#include "opencl/level_order.h"

namespace bvhlab::opencl {
namespace {

/// Model of collapse.cl.
struct Model {
    double scale;
    float traversal, intersection;
    std::uint32_t most_references, first_leaf;
};
static_assert(sizeof(Model) == 24);

Model model_of(Commands& commands, const DeviceBinary& binary, const CostModel& model,
               std::uint32_t most_references) {
    const double root_area = commands.value(binary.boxes, 0).half_area();
    return {root_area > 0.0 ? 1.0 / root_area : 0.0, float(model.traversal),
            float(model.intersection), most_references, binary.first_leaf()};
}

/// Nodes that can be planned at once, in any order.
struct Ready {
    Buffer<std::uint32_t> nodes, count;

    /// Two of the nodes listed never lie one below the other, and each has at least two references
    /// below it.
    Ready(Commands& commands, std::size_t references)
        : nodes(commands.buffer<std::uint32_t>(references / 2)),
          count(commands.buffer<std::uint32_t>(1)) {
        commands.fill(count, 0U);
    }
};

/// Plans all interior nodes (collapse.cl), each after its children.
void plan_upwards(Commands& commands, Program& program, const DeviceBinary& binary,
                  const Model& model, Plans& plans) {
    // A work-item takes a few microseconds for a node.
    constexpr std::uint32_t most_steps = 1U << 15U;
    Ready ready(commands, binary.reference_count()), next(commands, binary.reference_count());
    const auto arrived = commands.buffer<std::uint32_t>(binary.first_leaf());
    commands.fill(arrived, 0U);
    in_parts(binary.first_leaf(), [&](std::uint32_t start, std::uint32_t count) {
        commands.run(program["find_parents"], count, binary.children, binary.first_leaf(), start,
                     plans.parents, ready.nodes, ready.count);
    });
    for (std::uint32_t launch = 1;; ++launch) {
        const std::uint32_t listed = commands.value(ready.count, 0);
        if (listed == 0) return;
        commands.fill(next.count, 0U);
        in_parts(listed, [&](std::uint32_t start, std::uint32_t count) {
            commands.run(program["plan_upwards"], count, binary.children, binary.boxes,
                         plans.parents, model, ready.nodes, listed, start, launch, most_steps,
                         arrived, plans.nodes, plans.work, next.nodes, next.count);
        });
        std::swap(ready, next);
    }
}

/// The dynamic programme of bvh/collapse.cpp.
Plans plan(Commands& commands, const DeviceBinary& binary, unsigned branching, bool compressed,
           const CostModel& model, Token& token) {
    constexpr std::size_t most = std::size_t(1) << 28U;
    if (binary.reference_count() > most)
        throw std::length_error("the tree has more than 2^28 references");
    token.begin("collapsing");
    commands.stage("collapsing");
    Plans plans(commands, binary, branching, compressed);
    if (binary.reference_count() > 1) {
        const std::uint32_t most_references = compressed
                                                  ? CompressedNode::most_references
                                                  : std::numeric_limits<std::uint32_t>::max();
        Program program(commands.device(), {{"collapse.cl"}, plans.options()});
        plan_upwards(commands, program, binary, model_of(commands, binary, model, most_references),
                     plans);
    }
    token.advance(0.5F);
    return plans;
}

}  // namespace

Bvh collapse(Commands& commands, const DeviceBinary& binary, std::shared_ptr<const Mesh> mesh,
             const DeviceMesh& device_mesh, unsigned branching, const CostModel& model,
             Token& token) {
    if (branching != 2 && branching != 4 && branching != 8)
        throw std::invalid_argument("branching must be 2, 4 or 8");
    Plans plans = plan(commands, binary, branching, false, model, token);
    Bvh bvh = breadth_first_layout(commands, binary, std::move(plans), device_mesh);
    bvh.mesh = std::move(mesh);
    token.advance(1.0F);
    return bvh;
}

Bvh compress(Commands& commands, const DeviceBinary& binary, std::shared_ptr<const Mesh> mesh,
             const DeviceMesh& device_mesh, const CostModel& model, Token& token) {
    Plans plans = plan(commands, binary, CompressedBvh::branching, true, model, token);
    Bvh bvh = compressed_layout(commands, binary, std::move(plans), device_mesh);
    bvh.mesh = std::move(mesh);
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab::opencl
