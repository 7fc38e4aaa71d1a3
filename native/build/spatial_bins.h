// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/token.h"
#include "build/outline.h"
#include "build/reference_set.h"
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

/// The bins of one axis of a node: equal slabs between the node's lower and upper bound. Their boxes serve to choose
/// a plane and are exact up to rounding; the cut itself is made by clip.h.
class SpatialBins {
public:
    /// `node` must have an extent on the axis.
    void begin(const Box& node, int axis, int bin_count);

    /// Adds a reference to all bins that its triangle reaches: its box is cut at the planes between them ("chopped
    /// binning", Stich et al. 2009, section 4.2).
    void add(const Reference& reference, const Mesh& mesh);

    /// Adds the references of `other`, which has the same slabs.
    void merge(const SpatialBins& other);

    /// Improves `best` by the planes between bins that make at most `budget` duplicates of `count` references.
    /// Equal costs are decided by the lower plane.
    void find_split(std::size_t count, std::size_t budget, SpatialSplit& best) const;

private:
    using Row = std::array<float, most_spatial_bins + bin_lanes>;  ///< one bound of the bins' boxes
    using Counts = std::array<std::uint32_t, most_spatial_bins>;

    double position(float coordinate) const;
    int bin_of(float coordinate) const;
    float plane_below(int bin) const;
    void grow(int bin, int axis, float lower, float upper);
    void chop(const Reference& reference, const Triangle& triangle, int first, int last);

    int axis_ = 0, bin_count_ = 0;
    double lower_ = 0.0, width_ = 0.0, scale_ = 0.0;
    // Of the part in each bin on the other two axes. On the bins' own axis: lower bounds of references whose
    // first bin it is, upper bounds of those whose last bin it is.
    std::array<Row, 3> lowers_, uppers_;
    Counts enter_, exit_;  ///< references whose first, last bin it is
};

/// The best plane on any axis of cost below `limit`, x before y before z where equal; cost is `limit` where
/// there is none. `bounds` is the box of all references, `bins` scratch.
SpatialSplit find_spatial_split(const ReferenceView& node, const Box& bounds, const Mesh& mesh,
                                int bin_count, std::size_t budget, double limit,
                                SpatialBins& bins, const Token& token);

}  // namespace bvhlab
