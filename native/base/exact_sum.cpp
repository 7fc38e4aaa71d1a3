// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/exact_sum.h"

#include <cmath>
#include <cstddef>

namespace bvhlab {

void ExactSum::add(double value) {
    if (value == 0.0) return;  // many terms are: those of axis-parallel rays, or of small integers
    std::size_t kept = 0;
    for (const double part : parts_) {
        // Knuth's TwoSum: sum + error is value + part exactly.
        const double sum = value + part;
        const double part_seen = sum - value;
        const double error = (value - (sum - part_seen)) + (part - part_seen);
        if (error != 0.0) parts_[kept++] = error;
        value = sum;
    }
    parts_.resize(kept);
    if (value != 0.0) parts_.push_back(value);
}

void ExactSum::add_product(float x, float y, float z) {
    const double xy = double(x) * double(y);  // 48 bits: exact
    const double xyz = xy * double(z);
    add(std::fma(xy, double(z), -xyz));
    add(xyz);
}

void ExactSum::add_scaled(const ExactSum& other, double factor) {
    for (const double part : other.parts_) {
        const double product = part * factor;
        add(std::fma(part, factor, -product));
        add(product);
    }
}

void ExactSum::add_product(const ExactSum& factor, const ExactSum& other) {
    for (const double part : factor.parts_) add_scaled(other, part);
}

int ExactSum::sign() const {
    if (parts_.empty()) return 0;
    return parts_.back() > 0.0 ? 1 : -1;
}

double ExactSum::value() const {
    double sum = 0.0;
    for (const double part : parts_) sum += part;
    return sum;
}

}  // namespace bvhlab
