// SPDX-License-Identifier: GPL-3.0-or-later
// SIMD lanes over the candidates of one cluster. Compiled once per instruction set; the best for
// the processor is taken at run time.
#include "build/nearest_cluster.h"

#include <algorithm>
#include <limits>

// SSE2, SSE4, AVX2 and AVX-512 differ for this code; the targets between them do not.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "build/nearest_cluster.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, ClusterBoxes::padding>;
using IndexLanes = hn::RebindToSigned<Lanes>;
using Values = hn::Vec<Lanes>;

HWY_INLINE Values half_area(Values x, Values y, Values z) {
    return hn::Add(hn::Mul(x, y), hn::Mul(z, hn::Add(x, y)));
}

HWY_INLINE Values load(const Array<float>& plane, std::uint32_t i) {
    return hn::LoadU(Lanes(), plane.data() + i);
}

HWY_INLINE Values repeat(const Array<float>& plane, std::uint32_t i) {
    return hn::Set(Lanes(), plane[i]);
}

/// Looks at candidates before and after cluster i apart, so that i itself need not be masked out.
std::uint32_t nearest_of(const ClusterBoxes& boxes, std::uint32_t count, std::uint32_t radius,
                         std::uint32_t i) {
    const Lanes lanes;
    const IndexLanes index_lanes;
    const Array<float>&lower_x = boxes.lower[0], &upper_x = boxes.upper[0];
    const Array<float>&lower_y = boxes.lower[1], &upper_y = boxes.upper[1];
    const Array<float>&lower_z = boxes.lower[2], &upper_z = boxes.upper[2];
    const Values own_lower_x = repeat(lower_x, i), own_upper_x = repeat(upper_x, i);
    const Values own_lower_y = repeat(lower_y, i), own_upper_y = repeat(upper_y, i);
    const Values own_lower_z = repeat(lower_z, i), own_upper_z = repeat(upper_z, i);
    const auto areas_from = [&](std::uint32_t j) {
        return half_area(
            hn::Sub(hn::Max(own_upper_x, load(upper_x, j)), hn::Min(own_lower_x, load(lower_x, j))),
            hn::Sub(hn::Max(own_upper_y, load(upper_y, j)), hn::Min(own_lower_y, load(lower_y, j))),
            hn::Sub(hn::Max(own_upper_z, load(upper_z, j)),
                    hn::Min(own_lower_z, load(lower_z, j))));
    };

    // Keep by lane the least area, and its first candidate less the number of the lane.
    const Values infinity = hn::Set(lanes, std::numeric_limits<float>::infinity());
    Values least = infinity;
    auto nearest = hn::Zero(index_lanes);
    const auto take = [&](Values areas, std::uint32_t j) {
        const auto is_less = hn::Lt(areas, least);
        least = hn::Min(areas, least);
        nearest = hn::IfThenElse(hn::RebindMask(index_lanes, is_less),
                                 hn::Set(index_lanes, std::int32_t(j)), nearest);
    };
    const auto width = std::uint32_t(hn::Lanes(lanes));
    const auto visit = [&](std::uint32_t j, std::uint32_t end) {
        for (; j + width <= end; j += width) take(areas_from(j), j);
        if (j < end) take(hn::IfThenElse(hn::FirstN(lanes, end - j), areas_from(j), infinity), j);
    };
    visit(i - std::min(i, radius), i);
    visit(i + 1, std::min(i + radius, count - 1) + 1);

    // Choose between the lanes.
    const Values least_of_all = hn::MinOfLanes(lanes, least);
    const auto is_least = hn::RebindMask(index_lanes, hn::Eq(least, least_of_all));
    const auto candidates = hn::Add(nearest, hn::Iota(index_lanes, 0));
    const auto none = hn::Set(index_lanes, std::numeric_limits<std::int32_t>::max());
    return std::uint32_t(
        hn::GetLane(hn::MinOfLanes(index_lanes, hn::IfThenElse(is_least, candidates, none))));
}

void find_nearest_task(const ClusterBoxes& boxes, std::uint32_t count, std::uint32_t radius,
                       std::uint32_t begin, std::uint32_t end, std::uint32_t* nearest) {
    for (std::uint32_t i = begin; i < end; ++i) nearest[i] = nearest_of(boxes, count, radius, i);
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(find_nearest_task);

ClusterBoxes ClusterBoxes::with_room_for(std::size_t count) {
    ClusterBoxes boxes;
    for (auto* planes : {&boxes.lower, &boxes.upper}) {
        for (Array<float>& plane : *planes) {
            plane = Array<float>(count + padding);
            std::fill_n(plane.begin() + std::ptrdiff_t(count), padding, 0.0F);
        }
    }
    return boxes;
}

void find_nearest(const ClusterBoxes& boxes, std::uint32_t count, std::uint32_t radius,
                  std::uint32_t begin, std::uint32_t end, std::uint32_t* nearest) {
    HWY_DYNAMIC_DISPATCH(find_nearest_task)(boxes, count, radius, begin, end, nearest);
}

}  // namespace bvhlab
#endif  // HWY_ONCE
