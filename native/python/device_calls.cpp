// SPDX-License-Identifier: GPL-3.0-or-later
#include "python/device_calls.h"

#include "opencl/collapse.h"

namespace bvhlab {

std::shared_ptr<const opencl::DeviceTree> DeviceCopies::on(opencl::Commands& commands,
                                                           const Bvh& bvh) {
    const std::scoped_lock lock(mutex_);
    auto& copy = copies_[commands.device().info().id];
    if (!copy) copy = opencl::upload_tree(commands, bvh);
    return copy;
}

std::shared_ptr<opencl::Device> device_named(const std::string& device) {
    return device == "cpu" ? nullptr : opencl::Device::open(device);
}

void build_on_device(PyTree& tree, const BuilderInfo& builder, const Parameters& parameters,
                     Token& token) {
    const opencl::DeviceInfo& info = tree.device->info();
    opencl::Commands commands(*tree.device, token);
    try {
        tree.device_binary =
            opencl::build_tree(commands, *tree.mesh, builder, tree.model, parameters, token);
    } catch (const opencl::MemoryError& error) {
        throw opencl::MemoryError(std::string(builder.label) + " of " +
                                  std::to_string(tree.mesh->size()) +
                                  " triangles does not fit: " + error.what());
    }
    Origin& origin = tree.origin;
    origin.device = info.id;
    if (tree.device_binary->made_on_device) origin.tree_device = info.id;
    origin.threads = int(info.compute_units);
    origin.tree = tree.device_binary->times;
    origin.log = tree.device_binary->log;
}

Bvh collapse_on_device(const PyTree& tree, unsigned branching, NodeLayout layout, Origin& origin,
                       Token& token) {
    opencl::Commands commands(*tree.device, token);
    opencl::CallTimer timer(commands);
    const opencl::BuiltTree& built = *tree.device_binary;
    Bvh bvh =
        layout == NodeLayout::cwbvh
            ? opencl::compress(commands, built.binary, tree.mesh, built.mesh, tree.model, token)
            : opencl::collapse(commands, built.binary, tree.mesh, built.mesh, branching, tree.model,
                               token);
    origin.collapse = timer.stop();
    return bvh;
}

BinaryBvh downloaded(const PyTree& tree) {
    const Token token;
    opencl::Commands commands(*tree.device, token);
    return opencl::download(commands, tree.device_binary->binary);
}

TracedOnDevice trace_on_device(opencl::Device& device, const PyBvh& bvh, const RayBatch& rays,
                               const TraceOptions& options, opencl::TraceShape shape,
                               Token& token) {
    opencl::Commands commands(device, token);
    const auto tree = bvh.copies.on(commands, bvh.bvh);
    opencl::ShapedHits hits = opencl::trace(commands, bvh.bvh, *tree, rays, options, token, shape);
    return {std::move(hits), commands.times().transfer_seconds};
}

}  // namespace bvhlab
