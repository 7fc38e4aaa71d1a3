// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "scene/box.h"

namespace bvhlab {

/// Bits of a Morton code per axis, and in all: the paper's 60-bit codes.
inline constexpr int morton_bits_per_axis = 20;
inline constexpr int morton_bits = 3 * morton_bits_per_axis;

/// Spreads the lowest 21 bits of `value` so that two zero bits follow each.
constexpr std::uint64_t spread_by_three(std::uint64_t value) {
    value &= 0x1FFFFF;
    value = (value | value << 32) & 0x001F00000000FFFF;
    value = (value | value << 16) & 0x001F0000FF0000FF;
    value = (value | value << 8) & 0x100F00F00F00F00F;
    value = (value | value << 4) & 0x10C30C30C30C30C3;
    value = (value | value << 2) & 0x1249249249249249;
    return value;
}

/// Maps points of a box to cells of a grid of 2^20 cells per axis, and cells to their place on the
/// Morton curve. Every axis of the box is stretched to the whole grid; a flat axis maps to cell 0.
class MortonGrid {
public:
    explicit MortonGrid(const Box& box) : lower_(box.lower) {
        constexpr double last_cell = double((1 << morton_bits_per_axis) - 1);
        for (int axis = 0; axis < 3; ++axis) {
            const double extent = double(box.upper[axis]) - double(box.lower[axis]);
            scale_[axis] = extent > 0.0 ? last_cell / extent : 0.0;
        }
    }

    /// Code of the centre of `box`: x in the lowest bit of each triple, z in the highest.
    std::uint64_t code(const Box& box) const {
        return spread_by_three(cell(box, 0)) | spread_by_three(cell(box, 1)) << 1 |
               spread_by_three(cell(box, 2)) << 2;
    }

private:
    std::uint64_t cell(const Box& box, int axis) const {
        const double centre = 0.5 * (double(box.lower[axis]) + double(box.upper[axis]));
        return std::uint64_t((centre - double(lower_[axis])) * scale_[axis]);
    }

    glm::vec3 lower_;
    double scale_[3];
};

}  // namespace bvhlab
