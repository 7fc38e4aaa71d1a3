// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/device_tree.h"

#include <span>
#include <string>

#include "trace/traverse.h"

namespace bvhlab::opencl {
namespace {

template <class T>
Buffer<std::byte> upload_bytes(Commands& commands, const Array<T>& values) {
    return commands.upload(std::as_bytes(std::span(values)));
}

template <unsigned K>
void upload_arrays(Commands& commands, const WideBvh<K>& tree, DeviceTree& target) {
    target.nodes = upload_bytes(commands, tree.nodes);
    target.leaves = upload_bytes(commands, tree.blocks);
    target.block = WideBvh<K>::lanes;
}

void upload_arrays(Commands& commands, const CompressedBvh& tree, DeviceTree& target) {
    target.nodes = upload_bytes(commands, tree.nodes);
    target.leaves = upload_bytes(commands, tree.corners);
    target.block = CompressedNode::most_references + 1;  // vectors of four
    target.triangles = commands.upload(std::span(tree.triangles));
}

}  // namespace

std::shared_ptr<const DeviceTree> upload_tree(Commands& commands, const Bvh& bvh) {
    const auto tree = std::make_shared<DeviceTree>();
    tree->branching = bvh.branching();
    tree->layout = bvh.layout();
    tree->stack_size = stack_size(bvh);
    tree->bounds = bvh.mesh->bounds;
    try {
        std::visit([&](const auto& arrays) { upload_arrays(commands, arrays, *tree); }, bvh.tree);
    } catch (const MemoryError& error) {
        throw MemoryError("a tree of " + std::to_string(bvh.node_bytes() >> 20U) +
                          " MiB of nodes and " + std::to_string(bvh.leaf_bytes() >> 20U) +
                          " MiB of leaves does not fit: " + error.what());
    }
    return tree;
}

}  // namespace bvhlab::opencl
