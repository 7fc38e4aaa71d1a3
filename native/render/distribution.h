// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "base/array.h"

namespace bvhlab {

/// An index drawn in proportion to its weight, and what is left of the random number: where in the
/// share of that index it fell, in [0, 1).
struct WeightedChoice {
    std::size_t index;
    double rest;
};

/// Weights are summed in blocks, so that a choice is a binary search over few sums and a scan of
/// one cache line; and it is monotonic in the random number, which keeps strata.
inline constexpr std::size_t weights_per_block = 16;

/// Number of sums that `sum_blocks` writes.
inline std::size_t block_sum_count(std::size_t weights) {
    return (weights + weights_per_block - 1) / weights_per_block + 1;
}

/// Fills `sums` with the sum of the weights before each block; the last entry is the sum of all.
inline void sum_blocks(std::span<const float> weights, std::span<double> sums) {
    double sum = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        if (i % weights_per_block == 0) sums[i / weights_per_block] = sum;
        sum += double(weights[i]);
    }
    sums.back() = sum;
}

/// Requires a weight above 0. `random` in [0, 1); an index of weight 0 is never drawn.
inline WeightedChoice choose_by_weight(std::span<const float> weights, std::span<const double> sums,
                                       double random) {
    const double target = std::min(random * sums.back(), std::nextafter(sums.back(), 0.0));
    const auto block = std::upper_bound(sums.begin(), sums.end(), target) - sums.begin() - 1;
    double below = sums[std::size_t(block)];
    std::size_t index = std::size_t(block) * weights_per_block;
    // The sums were added up in this order, so the block's end is not passed.
    while (below + double(weights[index]) <= target) below += double(weights[index++]);
    const double rest = (target - below) / double(weights[index]);
    return {index, std::clamp(rest, 0.0, 1.0 - 0x1p-53)};
}

/// Draws indices in proportion to their weights: finite and not negative.
class Distribution {
public:
    Distribution() = default;
    explicit Distribution(Array<float> weights)
        : weights_(std::move(weights)), sums_(block_sum_count(weights_.size())) {
        sum_blocks(weights_, sums_);
    }

    double total() const { return sums_.empty() ? 0.0 : sums_.back(); }
    double probability(std::size_t index) const { return double(weights_[index]) / sums_.back(); }

    /// Requires total() > 0.
    WeightedChoice choose(double random) const { return choose_by_weight(weights_, sums_, random); }

private:
    friend struct LightParts;  ///< hands what was prepared to devices

    Array<float> weights_;
    Array<double> sums_;
};

}  // namespace bvhlab
