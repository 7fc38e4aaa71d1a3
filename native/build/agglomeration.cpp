// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once per instruction set; the best for the processor is taken at run time.
#include "build/agglomeration.h"

#include <limits>

// No processor lacks SSE4 but has SSSE3, and 512 bits do not help rows of a few boxes.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "build/agglomeration.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 8>;
using Values = hn::Vec<Lanes>;

/// Clusters in slots; a slot without one holds a box without bounds, whose union with any other has
/// infinite area.
class Clusters {
public:
    Clusters(BoxRows& boxes, int count) : boxes_(boxes), end_(count) {
        for (int slot = count; slot < BoxRows::capacity; ++slot) clear(slot);
        for (int slot = 0; slot < count; ++slot) part_[slot] = std::uint8_t(slot);
    }

    /// The last slot that has a cluster.
    int last() {
        while (part_[end_ - 1] == none) --end_;
        return end_ - 1;
    }

    /// The slot whose union with `slot` has the least area: `preferred` if it is one of them.
    int nearest(int slot, int preferred) const {
        const Lanes lanes;
        const Values infinite = hn::Set(lanes, infinity), self = hn::Set(lanes, float(slot));
        alignas(64) float areas[BoxRows::capacity];
        Values least = infinite;
        for (int i = 0; i < end_; i += width()) {
            const Values x = union_extent(0, slot, i), y = union_extent(1, slot, i);
            const Values z = union_extent(2, slot, i);
            const Values area = hn::Add(hn::Mul(x, y), hn::Mul(z, hn::Add(x, y)));
            const auto is_self = hn::Eq(hn::Iota(lanes, float(i)), self);
            const Values other = hn::IfThenElse(is_self, infinite, area);
            hn::Store(other, lanes, areas + i);
            least = hn::Min(least, other);
        }
        least = hn::MinOfLanes(lanes, least);
        if (preferred >= 0 && areas[preferred] == hn::GetLane(least)) return preferred;
        for (int i = 0;; i += width()) {
            const auto found = hn::FindFirstTrue(lanes, hn::Eq(hn::Load(lanes, areas + i), least));
            if (found >= 0) return i + int(found);
        }
    }

    /// Unites two clusters to one, in the lower slot, which is `part` from now on.
    Merge merge(int a, int b, int part) {
        const int kept = a < b ? a : b, emptied = a < b ? b : a;
        for (int axis = 0; axis < 3; ++axis) {
            float& lower = boxes_.lower[axis][kept];
            float& upper = boxes_.upper[axis][kept];
            const float other_lower = boxes_.lower[axis][emptied];
            const float other_upper = boxes_.upper[axis][emptied];
            lower = other_lower < lower ? other_lower : lower;
            upper = other_upper > upper ? other_upper : upper;
        }
        const Merge merge{part_[kept], part_[emptied]};
        part_[kept] = std::uint8_t(part);
        part_[emptied] = none;
        clear(emptied);
        return merge;
    }

private:
    static constexpr std::uint8_t none = 0xFF;
    static constexpr float infinity = std::numeric_limits<float>::infinity();
    static int width() { return int(hn::Lanes(Lanes{})); }

    /// Extents of the unions of a cluster with the clusters from slot `first` on.
    HWY_INLINE Values union_extent(int axis, int slot, int first) const {
        const Lanes lanes;
        const Values lower = hn::Set(lanes, boxes_.lower[axis][slot]);
        const Values upper = hn::Set(lanes, boxes_.upper[axis][slot]);
        return hn::Sub(hn::Max(upper, hn::Load(lanes, &boxes_.upper[axis][first])),
                       hn::Min(lower, hn::Load(lanes, &boxes_.lower[axis][first])));
    }

    void clear(int slot) {
        for (int axis = 0; axis < 3; ++axis) {
            boxes_.lower[axis][slot] = -infinity;
            boxes_.upper[axis][slot] = infinity;
        }
    }

    BoxRows& boxes_;
    std::uint8_t part_[BoxRows::capacity];  // what a cluster is called, or `none`
    int end_;                               // of the slots in use
};

/// A union has no less area than its parts, so two clusters that are nearest to each other stay so
/// whatever else is merged, and may be merged at once. A chain from one cluster to its nearest, and
/// so on, ends in such a pair: quadratic work where a search of all pairs is cubic.
void agglomerate_task(BoxRows& boxes, int count, Merge* merges) {
    Clusters clusters(boxes, count);
    int chain[BoxRows::capacity], length = 0;
    for (int made = 0; made < count - 1;) {
        if (length == 0) chain[length++] = clusters.last();
        const int slot = chain[length - 1], before = length > 1 ? chain[length - 2] : -1;
        const int nearest = clusters.nearest(slot, before);
        if (nearest != before) {
            chain[length++] = nearest;
            continue;
        }
        merges[made] = clusters.merge(slot, before, count + made);
        ++made;
        length -= 2;
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(agglomerate_task);

void agglomerate(BoxRows& boxes, int count, Merge* merges) {
    HWY_DYNAMIC_DISPATCH(agglomerate_task)(boxes, count, merges);
}

}  // namespace bvhlab
#endif  // HWY_ONCE
