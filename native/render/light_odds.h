// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "render/distribution.h"

namespace bvhlab {

/// With which probability each of a few lights, or groups of lights, is drawn.
class LightOdds {
public:
    static constexpr std::size_t most = 16;

    /// Adds the next entry; `weight` is finite, not negative. At most `most` are added.
    void add(double weight) {
        sums_[count_ + 1] = sums_[count_] + weight;
        ++count_;
    }

    /// Whether nothing has any weight, so that nothing can be drawn.
    bool empty() const { return !(sums_[count_] > 0.0); }

    double probability(std::size_t entry) const {
        return empty() ? 0.0 : (sums_[entry + 1] - sums_[entry]) / sums_[count_];
    }

    /// `random` in [0, 1); monotonic, never an entry of probability 0. Requires !empty().
    WeightedChoice choose(double random) const {
        double target = random * sums_[count_];
        if (!(target < sums_[count_])) target = std::nextafter(sums_[count_], 0.0);
        std::size_t entry = 0;
        while (sums_[entry + 1] <= target) ++entry;
        const double rest = (target - sums_[entry]) / (sums_[entry + 1] - sums_[entry]);
        return {entry, std::clamp(rest, 0.0, 1.0 - 0x1p-53)};
    }

private:
    friend struct LightParts;  ///< hands what was prepared to devices

    std::size_t count_ = 0;
    std::array<double, most + 1> sums_{0.0};
};

}  // namespace bvhlab
