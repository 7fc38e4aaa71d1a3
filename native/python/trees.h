// SPDX-License-Identifier: GPL-3.0-or-later
// Trees as Python holds them, with what their `stats` tell.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "build/build_log.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"
#include "bvh/wide_bvh.h"
#include "opencl/builders.h"
#include "opencl/device_tree.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Where a tree was made.
struct Origin {
    std::string builder;
    std::string device = "cpu";       ///< what was asked for, by its full id
    std::string tree_device = "cpu";  ///< what made the binary tree: the CPU core for some builders
    int threads = 0;                  ///< of the CPU; compute units of another device
    opencl::CallTimes tree, collapse;
    BuildLog log;
};

/// A builder's binary tree, which can be collapsed to any branching factor (class `Tree` in
/// Python).
struct PyTree {
    std::shared_ptr<Mesh> mesh;
    CostModel model;
    Origin origin;
    BinaryBvh binary;                                ///< of device cpu
    std::shared_ptr<opencl::Device> device;          ///< null: cpu
    std::optional<opencl::BuiltTree> device_binary;  ///< of another device

    std::size_t reference_count() const {
        return device ? device_binary->binary.reference_count() : binary.reference_count();
    }
};

/// A tree's copies on devices: uploaded at first use, and gone with the tree.
class DeviceCopies {
public:
    /// Throws as opencl::upload_tree().
    std::shared_ptr<const opencl::DeviceTree> on(opencl::Commands& commands, const Bvh& bvh);

private:
    std::mutex mutex_;
    std::map<std::string, std::shared_ptr<const opencl::DeviceTree>> copies_;
};

/// A finished tree (class `Bvh` in Python).
struct PyBvh {
    Bvh bvh;
    Origin origin;
    mutable DeviceCopies copies;
};

}  // namespace bvhlab
