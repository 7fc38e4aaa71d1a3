// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/token.h"
#include "build/outline.h"
#include "build/reference_set.h"
#include "build/running_box.h"
#include "scene/mesh.h"

namespace bvhlab {

inline constexpr int most_spatial_bins = 256;

/// A division of a node's references at a plane; those on both sides are duplicated.
struct SpatialSplit {
    /// Half areas of the two sides' boxes, each times its number of references.
    double cost;
    int axis = 0;
    float plane = 0.0F;
};

/// The bins of one axis of a node: equal slabs between the node's lower and upper bound. Plane i
/// lies below bin i.
///
/// All references are counted first. Whole references alone bound the cost of each plane from
/// below, and where that bound is too high already, mostly near the node's ends, triangles need not
/// be cut. Then all references are added, with their boxes cut at the remaining planes ("chopped
/// binning", Stich et al. 2009, section 4.2). These boxes serve to choose a plane and are exact up
/// to rounding; the cut itself is made by clip.h.
class SpatialBins {
public:
    /// `node` must have an extent on the axis.
    void begin(const Box& node, int axis, int bin_count);
    void count(const Reference& reference);
    void merge_counts(const SpatialBins& other);

    /// Finds the planes that may cost less than `limit` with at most `budget` duplicates of `count`
    /// references, and readies their bins. Returns false where there is none.
    bool find_planes(std::size_t count, std::size_t budget, double limit);
    void add(const Reference& reference, const Mesh& mesh);
    void merge_parts(const SpatialBins& other);

    /// Improves `best` by those planes. Equal costs are decided by the lower plane.
    void find_split(std::size_t count, std::size_t budget, SpatialSplit& best) const;

private:
    /// One bound of the bins' boxes, from the bin below the first plane on.
    using Row = std::array<float, most_spatial_bins + bin_lanes>;
    using Counts = std::array<std::uint32_t, most_spatial_bins>;

    struct Range {
        int first, last;
    };

    double position(float coordinate) const;
    int bin_of(float coordinate) const;
    Range bins_of(const Reference& reference) const;
    float plane_below(int bin) const;
    int other_axis(int i) const { return (axis_ + 1 + i) % 3; }
    void ready_rows();
    void grow(int bin, int i, float lower, float upper);
    void chop(const Reference& reference, const Triangle& triangle, Range bins);

    int axis_ = 0, bin_count_ = 0;
    double lower_ = 0.0, scale_ = 0.0, width_ = 0.0;
    std::array<RunningBox, most_spatial_bins> begin_here_, end_here_;  ///< whole references
    Counts enter_, exit_;                 ///< references whose first, last bin it is
    Range planes_{0, 0};                  ///< that may be good
    std::array<Row, 2> lowers_, uppers_;  ///< of the parts in each bin, on the two other axes
};

/// The best plane on any axis of cost below `limit`, x before y before z where equal; cost is
/// `limit` where there is none. `bounds` is the box of all references, `bins` scratch.
SpatialSplit find_spatial_split(const ReferenceView& node, const Box& bounds, const Mesh& mesh,
                                int bin_count, std::size_t budget, double limit, SpatialBins& bins,
                                const Token& token);

}  // namespace bvhlab
