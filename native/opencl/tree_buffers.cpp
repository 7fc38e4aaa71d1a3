// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

static_assert(sizeof(Box) == 24 && sizeof(glm::uvec3) == 12);

DeviceBinary DeviceBinary::with_references(Commands& commands, std::size_t count) {
    return {commands.buffer<Box>(2 * count - 1), commands.buffer<BinaryBvh::Children>(count - 1),
            commands.buffer<std::uint32_t>(count)};
}

DeviceMesh upload(Commands& commands, const Mesh& mesh) {
    return {commands.upload(std::span(mesh.vertices)), commands.upload(std::span(mesh.triangles)),
            mesh.bounds};
}

DeviceBinary upload(Commands& commands, const BinaryBvh& bvh) {
    return {commands.upload(std::span(bvh.boxes)), commands.upload(std::span(bvh.children)),
            commands.upload(std::span(bvh.references))};
}

BinaryBvh download(Commands& commands, const DeviceBinary& bvh) {
    BinaryBvh host = BinaryBvh::with_references(bvh.reference_count());
    commands.download(bvh.boxes, std::span(host.boxes));
    commands.download(bvh.children, std::span(host.children));
    commands.download(bvh.references, std::span(host.references));
    return host;
}

}  // namespace bvhlab::opencl
