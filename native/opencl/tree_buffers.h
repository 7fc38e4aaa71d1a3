// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "bvh/binary_bvh.h"
#include "opencl/commands.h"
#include "scene/mesh.h"

namespace bvhlab::opencl {

/// A mesh on a device, laid out as on the host.
struct DeviceMesh {
    Buffer<glm::vec3> vertices;    ///< 12 bytes each
    Buffer<glm::uvec3> triangles;  ///< 12 bytes each
    Box bounds;

    std::size_t size() const { return triangles.size(); }
};

/// A binary tree on a device, node for node as BinaryBvh.
struct DeviceBinary {
    Buffer<Box> boxes;                     ///< 2n - 1
    Buffer<BinaryBvh::Children> children;  ///< n - 1
    Buffer<std::uint32_t> references;      ///< n

    std::size_t reference_count() const { return references.size(); }
    std::uint32_t first_leaf() const { return std::uint32_t(children.size()); }

    static DeviceBinary with_references(Commands& commands, std::size_t count);
};

DeviceMesh upload(Commands& commands, const Mesh& mesh);
DeviceBinary upload(Commands& commands, const BinaryBvh& bvh);
BinaryBvh download(Commands& commands, const DeviceBinary& bvh);

}  // namespace bvhlab::opencl
