// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// The levels above `count` leaf boxes, which begin at boxes[first]: what range_box of
/// range_boxes.cl needs. Enqueues and does not wait.
Buffer<Box> range_box_levels(Commands& commands, const Buffer<Box>& boxes, std::size_t first,
                             std::size_t count);

}  // namespace bvhlab::opencl
