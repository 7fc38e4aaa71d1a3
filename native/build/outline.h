// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace bvhlab {

/// A line over the positions on an axis, which count bins.
struct Line {
    float start, step;
};

/// A triangle seen along an axis: its range at a position is from the greater of the two lower
/// lines to the lesser of the two upper ones. The edge from the lowest to the highest corner stands
/// on one side, the two edges at the middle corner on the other.
struct Outline {
    Line lower[2], upper[2];
};

/// The range of positions, and of values at them, that a part of a triangle takes up.
struct Part {
    float first, last, lowest, highest;
};

/// Bins that are grown at a time. Rows of bins need so many unused elements at their end.
inline constexpr int bin_lanes = 8;

/// Grows the bounds of `count` bins by the outline cropped to the part. Bin i is from position i to
/// i + 1, but the first and the last bin take in all of the part that is below and above. The
/// middle corner itself is not seen. The same on all processors: SIMD only changes the speed.
void grow_bins(const Outline& outline, const Part& part, int count, float* lowers, float* uppers);

}  // namespace bvhlab
