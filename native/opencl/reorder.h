// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "opencl/commands.h"
#include "scene/box.h"
#include "trace/ray.h"
#include "trace/reorder.h"

namespace bvhlab::opencl {

/// The order in which to trace the first `count` rays, at most 2^32 - 1, as order_rays() of
/// trace/reorder.h has it. `order` is not `off`. Kernels run in the stages "key" and "sort".
/// Enqueues and does not wait.
Buffer<std::uint32_t> order_rays(Commands& commands, const Buffer<Ray>& rays, std::size_t count,
                                 Reorder order, const Box& scene);

}  // namespace bvhlab::opencl
