// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "opencl/commands.h"
#include "opencl/device_tree.h"
#include "opencl/trace_shape.h"
#include "trace/trace.h"

namespace bvhlab::opencl {

/// Answers on a device, by ray. Each buffer is used only where asked for, and has room for all rays
/// then.
struct DeviceHits {
    Buffer<Hit> hits;               ///< closest hit; a miss as in trace/ray.h
    Buffer<std::uint8_t> occluded;  ///< any hit only: 1 where something was hit
    Buffer<std::uint32_t> node_visits, box_tests, triangle_tests;  ///< when counted

    /// All that `options` asks for.
    static DeviceHits with_rays(Commands& commands, std::size_t count, const TraceOptions& options);
};

/// Traces the first `count` rays, at most 2^31, which must be as core.trace() takes them. Kernels
/// run in the stages "key", "sort" and, for traversal, `stage`; in "choosing a shape" where two are
/// compared. Launches are sized to stay far below a second. Waits for all but the last commands.
/// Returns the shape that traced them; what is counted is always traced by `single`.
///
/// Throws std::invalid_argument for tests other than the default ones and for a shape that the tree
/// does not have, Cancelled between launches.
TraceShape trace_rays(Commands& commands, const DeviceTree& tree, const Buffer<Ray>& rays,
                      std::size_t count, const TraceOptions& options, const char* stage,
                      const DeviceHits& hits, TraceShape shape = TraceShape::automatic);

/// Hits, and which shape of kernel found them.
struct ShapedHits : Hits {
    TraceShape shape;
};

/// trace() of trace/trace.h on a device: the same hits bit for bit, the same counts. `tree` is
/// `bvh` uploaded. Times are the kernels' by the device's clock, without transfers and without the
/// choice of a shape. `threads` of the options is not used: the device takes all it has.
///
/// Throws as trace_rays().
ShapedHits trace(Commands& commands, const Bvh& bvh, const DeviceTree& tree, const RayBatch& rays,
                 const TraceOptions& options, Token& token,
                 TraceShape shape = TraceShape::automatic);

}  // namespace bvhlab::opencl
