// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "bvh/wide_bvh.h"
#include "opencl/commands.h"

namespace bvhlab::opencl {

/// A tree on a device, laid out as on the host, for tracing.
struct DeviceTree {
    unsigned branching;
    NodeLayout layout;
    unsigned block;          ///< triangles that are stored, or read, side by side
    std::size_t stack_size;  ///< entries that a ray's stack can need
    Box bounds;              ///< of the mesh: the same for all trees
    Buffer<std::byte> nodes;
    Buffer<std::byte> leaves;         ///< triangle blocks; cwbvh: rows of corners
    Buffer<std::uint32_t> triangles;  ///< cwbvh only: by reference

    /// Measured by the last launch, 0 before: launches are sized by them. They change no answer.
    mutable std::atomic<double> rays_per_second{0.0};
    mutable std::atomic<double> careful_rays_per_second{0.0};
};

/// Copies a tree. Throws MemoryError, saying how much the tree needs, where it does not fit.
std::shared_ptr<const DeviceTree> upload_tree(Commands& commands, const Bvh& bvh);

}  // namespace bvhlab::opencl
