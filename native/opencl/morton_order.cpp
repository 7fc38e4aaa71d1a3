// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/morton_order.h"

#include <type_traits>

#include "build/morton.h"
#include "opencl/radix_sort.h"

namespace bvhlab::opencl {

// Handed to the kernel as it is.
static_assert(std::is_standard_layout_v<MortonGrid> && sizeof(MortonGrid) == 40);

DeviceMortonOrder morton_order(Commands& commands, const DeviceMesh& mesh) {
    const std::size_t count = mesh.size();
    DeviceMortonOrder order{commands.buffer<Box>(count), commands.buffer<std::uint64_t>(count),
                            commands.buffer<std::uint32_t>(count)};
    Program program(commands.device(), {{"morton.cl"}, ""});
    commands.stage("Morton codes");
    commands.run(program["morton_codes"], count, mesh.vertices, mesh.triangles,
                 std::uint32_t(count), MortonGrid(mesh.bounds), order.boxes, order.codes,
                 order.references);
    commands.stage("sort");
    radix_sort(commands, order.codes, order.references, count, morton_bits);
    return order;
}

void place_leaf_boxes(Commands& commands, const Buffer<Box>& boxes,
                      const Buffer<std::uint32_t>& references, std::size_t first_node,
                      const Buffer<Box>& nodes) {
    Program program(commands.device(), {{"morton.cl"}, ""});
    commands.run(program["place_leaf_boxes"], references.size(), boxes, references,
                 std::uint32_t(references.size()), std::uint32_t(first_node), nodes);
}

}  // namespace bvhlab::opencl
