// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

namespace bvhlab {

/// A real number held without any rounding, as the exact sum of doubles that do not overlap: an
/// expansion (Shewchuk, *Adaptive Precision Floating-Point Arithmetic*, 1997, section 2).
///
/// Made for sums of products of up to seven finite floats: such products are multiples of 2^-1043
/// and smaller than 2^896, so that no part under- or overflows double and the sum is exact for
/// every finite input. Only for decisions that double cannot make: it is about a hundred times
/// slower.
class ExactSum {
public:
    /// Adds a double (Shewchuk's Grow-Expansion).
    void add(double value);

    /// Adds x * y * z.
    void add_product(float x, float y, float z);

    /// Adds factor * other; |factor| is a float or a part of another sum.
    void add_scaled(const ExactSum& other, double factor);

    /// Adds factor * other.
    void add_product(const ExactSum& factor, const ExactSum& other);

    /// -1, 0 or 1: exact.
    int sign() const;

    /// The nearest double or its neighbour.
    double value() const;

private:
    std::vector<double> parts_;  ///< by increasing magnitude, none zero
};

}  // namespace bvhlab
