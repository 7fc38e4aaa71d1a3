// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/quantise.h"

#include <algorithm>
#include <cmath>

namespace bvhlab {
namespace {

constexpr int least_exponent = -126;
constexpr int bias = 127;
constexpr unsigned most_steps = 255;

/// One axis of a node's grid.
struct Grid {
    float origin, step;

    /// As CompressedNode::plane.
    float plane(unsigned multiple) const { return origin + float(multiple) * step; }

    std::uint8_t below(float lower) const {
        const double steps = std::floor((double(lower) - double(origin)) / double(step));
        unsigned multiple = unsigned(std::min(steps, double(most_steps)));
        while (plane(multiple) > lower) --multiple;  // ends at the origin
        return std::uint8_t(multiple);
    }

    std::uint8_t above(float upper) const {
        const double steps = std::ceil((double(upper) - double(origin)) / double(step));
        unsigned multiple = unsigned(std::min(steps, double(most_steps)));
        while (plane(multiple) < upper) ++multiple;  // ends at the last: see exponent_for
        return std::uint8_t(multiple);
    }
};

float power_of_two(int exponent) {
    return std::bit_cast<float>(std::uint32_t(exponent + bias) << 23);
}

/// The least exponent with which 255 steps lead from `lower` to `upper` or beyond.
int exponent_for(float lower, float upper) {
    const double step = (double(upper) - double(lower)) / double(most_steps);
    if (step == 0.0) return least_exponent;
    int exponent;
    if (std::frexp(step, &exponent) == 0.5) --exponent;  // step is 2^(exponent - 1), else less
    exponent = std::max(exponent, least_exponent);
    // The quotient's rounding may have cost one.
    while (Grid{lower, power_of_two(exponent)}.plane(most_steps) < upper) ++exponent;
    return exponent;
}

}  // namespace

void quantise(std::span<const Box> boxes, std::span<const std::uint8_t> slots,
              CompressedNode& node) {
    Box all = Box::empty();
    for (const Box& box : boxes) all.grow(box);
    for (int axis = 0; axis < 3; ++axis) {
        const int exponent = exponent_for(all.lower[axis], all.upper[axis]);
        const Grid grid{all.lower[axis], power_of_two(exponent)};
        node.origin[axis] = grid.origin;
        node.exponent[axis] = std::uint8_t(exponent + bias);
        std::fill_n(node.planes[axis], 8, std::uint8_t(most_steps));
        std::fill_n(node.planes[axis + 3], 8, std::uint8_t(0));
        for (std::size_t i = 0; i < boxes.size(); ++i) {
            node.planes[axis][slots[i]] = grid.below(boxes[i].lower[axis]);
            node.planes[axis + 3][slots[i]] = grid.above(boxes[i].upper[axis]);
        }
    }
}

}  // namespace bvhlab
