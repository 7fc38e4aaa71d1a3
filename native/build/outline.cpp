// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once per instruction set; the best for the processor is taken at run time.
#include "build/outline.h"

// No processor lacks SSE4 but has SSSE3, and 512 bits do not help loops of a few bins.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "build/outline.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, bin_lanes>;
using Values = hn::Vec<Lanes>;

HWY_INLINE Values at(const Line& line, Values positions) {
    const Lanes lanes;
    return hn::Add(hn::Set(lanes, line.start), hn::Mul(hn::Set(lanes, line.step), positions));
}

HWY_INLINE Values lower_at(const Outline& outline, Values positions) {
    return hn::Max(at(outline.lower[0], positions), at(outline.lower[1], positions));
}

HWY_INLINE Values upper_at(const Outline& outline, Values positions) {
    return hn::Min(at(outline.upper[0], positions), at(outline.upper[1], positions));
}

void grow_bins_task(const Outline& outline, const Part& part, int count, float* lowers,
                    float* uppers) {
    const Lanes lanes;
    const Values zero = hn::Zero(lanes), one = hn::Set(lanes, 1.0F);
    const Values end = hn::Set(lanes, float(count));
    const Values first = hn::Set(lanes, part.first), last = hn::Set(lanes, part.last);
    const Values lowest = hn::Set(lanes, part.lowest), highest = hn::Set(lanes, part.highest);
    for (int i = 0; i < count; i += int(hn::Lanes(lanes))) {
        const Values bins = hn::Iota(lanes, float(i));
        const Values next = hn::Add(bins, one);
        const Values from = hn::IfThenElse(hn::Eq(bins, zero), first, bins);
        const Values to = hn::IfThenElse(hn::Eq(next, end), last, next);
        const Values lower = hn::Min(lower_at(outline, from), lower_at(outline, to));
        const Values upper = hn::Max(upper_at(outline, from), upper_at(outline, to));
        const Values cropped_lower = hn::Min(hn::Max(lower, lowest), highest);
        const Values cropped_upper = hn::Max(hn::Min(upper, highest), lowest);
        const Values old_lower = hn::LoadU(lanes, lowers + i);
        const Values old_upper = hn::LoadU(lanes, uppers + i);
        const auto is_used = hn::Lt(bins, end);
        hn::StoreU(hn::IfThenElse(is_used, hn::Min(cropped_lower, old_lower), old_lower), lanes,
                   lowers + i);
        hn::StoreU(hn::IfThenElse(is_used, hn::Max(cropped_upper, old_upper), old_upper), lanes,
                   uppers + i);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(grow_bins_task);

void grow_bins(const Outline& outline, const Part& part, int count, float* lowers, float* uppers) {
    HWY_DYNAMIC_DISPATCH(grow_bins_task)(outline, part, count, lowers, uppers);
}

}  // namespace bvhlab
#endif  // HWY_ONCE
