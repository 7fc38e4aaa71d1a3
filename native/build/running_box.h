// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstring>

#include "build/reference_set.h"

namespace bvhlab {

/// A box that grows by one reference after the other, as two vectors of four floats (a language
/// extension of GCC and Clang, one instruction each on every 64-bit processor). The fourth lanes
/// hold nothing of use.
class RunningBox {
public:
    RunningBox() = default;  // not initialised
    explicit RunningBox(const Box& box)
        : lower_{box.lower.x, box.lower.y, box.lower.z, 0.0F},
          upper_{box.upper.x, box.upper.y, box.upper.z, 0.0F} {}

    void grow(const Reference& reference) {
        static_assert(offsetof(Reference, box.upper) + sizeof(Floats) <= sizeof(Reference));
        const auto* bytes = reinterpret_cast<const char*>(&reference);
        Floats lower, upper;
        std::memcpy(&lower, bytes + offsetof(Reference, box.lower), sizeof lower);
        std::memcpy(&upper, bytes + offsetof(Reference, box.upper), sizeof upper);
        grow(lower, upper);
    }

    void grow(const RunningBox& box) { grow(box.lower_, box.upper_); }

    /// As Box::half_area, for a box that is not empty.
    double half_area() const {
        const double x = double(upper_[0]) - double(lower_[0]);
        const double y = double(upper_[1]) - double(lower_[1]);
        const double z = double(upper_[2]) - double(lower_[2]);
        return x * y + z * (x + y);
    }

    float lower(int axis) const { return lower_[axis]; }
    float upper(int axis) const { return upper_[axis]; }

    Box box() const {
        return {{lower_[0], lower_[1], lower_[2]}, {upper_[0], upper_[1], upper_[2]}};
    }

private:
    using Floats = float __attribute__((vector_size(16)));

    void grow(Floats lower, Floats upper) {
        lower_ = lower < lower_ ? lower : lower_;
        upper_ = upper > upper_ ? upper : upper_;
    }

    Floats lower_, upper_;
};

}  // namespace bvhlab
