// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// build/morton_order.h on a device.
struct DeviceMortonOrder {
    Buffer<Box> boxes;                 ///< by triangle
    Buffer<std::uint64_t> codes;       ///< 60 bits, ascending, by place
    Buffer<std::uint32_t> references;  ///< triangle by place; equal codes in the order of the mesh
};

/// Sorts the triangles by the Morton code of their box centres. Enqueues and does not wait; stages
/// "Morton codes" and "sort".
DeviceMortonOrder morton_order(Commands& commands, const DeviceMesh& mesh);

/// Writes to nodes[first_node + i] the box of the triangle references[i], for all references.
void place_leaf_boxes(Commands& commands, const Buffer<Box>& boxes,
                      const Buffer<std::uint32_t>& references, std::size_t first_node,
                      const Buffer<Box>& nodes);

}  // namespace bvhlab::opencl
