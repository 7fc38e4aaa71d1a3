// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "base/parallel.h"
#include "build/builder.h"
#include "opencl/commands.h"
#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// What a call took. Copies and the compiling of programs are no part of `seconds`.
struct CallTimes {
    double seconds = 0.0;          ///< wall clock, from the first command to the last
    double program_seconds = 0.0;  ///< building programs, or reading them from the cache
    Times device;                  ///< kernels and copies, by the device's clock
};

/// Takes the times of what is done with one Commands from here on.
class CallTimer {
public:
    explicit CallTimer(Commands& commands);

    /// Waits for all commands.
    CallTimes stop();

private:
    Commands& commands_;
    double programs_before_, transfers_before_;
    Stopwatch watch_;
};

/// Whether the kernels make a builder's tree. `sah`, `sbvh` and `hybrid` are made by the CPU core
/// on every device, as the paper does. Throws std::invalid_argument for a builder that no device
/// has, naming those there are.
bool made_on_device(std::string_view builder);

/// A binary tree on a device.
struct BuiltTree {
    DeviceMesh mesh;
    DeviceBinary binary;
    bool made_on_device;
    BuildLog log;
    CallTimes times;
};

/// Builds a tree with a device: the CPU builder's, node for node. Throws as made_on_device, and
/// MemoryError, Error or Cancelled.
BuiltTree build_tree(Commands& commands, const Mesh& mesh, const BuilderInfo& builder,
                     const CostModel& model, const Parameters& parameters, Token& token);

}  // namespace bvhlab::opencl
