// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/range_boxes.h"

namespace bvhlab::opencl {

Buffer<Box> range_box_levels(Commands& commands, const Buffer<Box>& boxes, std::size_t first,
                             std::size_t count) {
    std::size_t all = 0;
    for (std::size_t size = count; size > 1; size = (size + 1) / 2) all += (size + 1) / 2;
    auto levels = commands.buffer<Box>(all);
    Program program(commands.device(), {{"range_boxes.cl"}, ""});
    Kernel& unite_pairs = program["unite_pairs"];
    const Buffer<Box>* below = &boxes;
    std::size_t begin = 0;
    for (std::size_t size = count; size > 1; size = (size + 1) / 2) {
        commands.run(unite_pairs, (size + 1) / 2, *below, std::uint32_t(first), std::uint32_t(size),
                     levels, std::uint32_t(begin));
        below = &levels;
        first = begin;
        begin += (size + 1) / 2;
    }
    return levels;
}

}  // namespace bvhlab::opencl
