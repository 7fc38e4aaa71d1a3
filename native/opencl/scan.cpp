// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/scan.h"

#include <algorithm>
#include <span>

namespace bvhlab::opencl {
namespace {

constexpr std::size_t values_per_item = 16;  // VALUES_PER_ITEM of scan.cl
constexpr std::size_t largest_group = 256;   // so that a tile fits into 32 KiB of local memory

}  // namespace

void Scan::operator()(const Buffer<std::uint32_t>& values, std::size_t count,
                      const Buffer<std::uint32_t>& total) {
    if (count == 0) {
        const std::uint32_t zero = 0;
        commands_.upload(std::span(&zero, 1), total);
        return;
    }
    Kernel &sum_tiles = program_["sum_tiles"], &scan_tiles = program_["scan_tiles"];
    const std::size_t group = std::min(
        {commands_.work_group, largest_group, sum_tiles.largest_group, scan_tiles.largest_group});
    const std::size_t tiles = (count + group * values_per_item - 1) / (group * values_per_item);
    const Range range(tiles * group, group);
    const Local partial{group * sizeof(std::uint32_t)};
    const Local tile{group * (values_per_item + 1) * sizeof(std::uint32_t)};
    const auto offsets = commands_.buffer<std::uint32_t>(tiles);
    if (tiles > 1) {
        commands_.run(sum_tiles, range, values, std::uint32_t(count), offsets, partial);
        (*this)(offsets, tiles, total);
    }
    commands_.run(scan_tiles, range, values, std::uint32_t(count), offsets,
                  std::uint32_t(tiles > 1), total, tile, partial);
}

void exclusive_scan(Commands& commands, const Buffer<std::uint32_t>& values, std::size_t count,
                    const Buffer<std::uint32_t>& total) {
    Scan scan(commands);
    scan(values, count, total);
}

}  // namespace bvhlab::opencl
