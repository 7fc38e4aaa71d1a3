// SPDX-License-Identifier: GPL-3.0-or-later
// What a call does whose device is not cpu.
#pragma once

#include <memory>
#include <string>

#include "build/builder.h"
#include "opencl/device.h"
#include "opencl/trace.h"
#include "python/trees.h"
#include "trace/trace.h"

namespace bvhlab {

/// Null for "cpu"; opened at first use otherwise. "opencl" is the first that can be used, GPUs
/// before others. Takes a while: without the GIL. Throws std::invalid_argument listing the devices
/// there are, opencl::Error with the reason for one that cannot be used.
std::shared_ptr<opencl::Device> device_named(const std::string& device);

/// Fills a tree whose mesh, model and device are set.
void build_on_device(PyTree& tree, const BuilderInfo& builder, const Parameters& parameters,
                     Token& token);

/// The tree of a device as one to trace; `origin` gets the collapse's times.
Bvh collapse_on_device(const PyTree& tree, unsigned branching, NodeLayout layout, Origin& origin,
                       Token& token);

/// The binary tree as it is on the host.
BinaryBvh downloaded(const PyTree& tree);

struct TracedOnDevice {
    opencl::ShapedHits hits;
    double transfer_seconds;  ///< all copies: the first call uploads the tree
};

TracedOnDevice trace_on_device(opencl::Device& device, const PyBvh& bvh, const RayBatch& rays,
                               const TraceOptions& options, opencl::TraceShape shape, Token& token);

}  // namespace bvhlab
