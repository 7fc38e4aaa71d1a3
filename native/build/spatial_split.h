// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/array.h"
#include "base/token.h"
#include "build/reference_set.h"
#include "build/spatial_bins.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Which side of a plane each reference of a node goes to.
struct SpatialDivision {
    enum Side : std::uint8_t { left_side, right_side, both_sides, undecided };

    Array<Side> sides;
    Array<Reference> left_parts, right_parts;  ///< of the references on both sides, in list order
    std::size_t left_size = 0, right_size = 0;

    std::size_t duplicates() const { return left_parts.size(); }
};

/// Decides for each reference that the plane cuts whether to cut it, or to put it whole on the side
/// where it costs less ("reference unsplitting", Stich et al. 2009, section 4.4), one after the
/// other with the boxes and counts so far. At most `budget` references are cut. A side may end up
/// empty: then the split is useless.
void decide_sides(const ReferenceView& node, const SpatialSplit& split, const Mesh& mesh,
                  std::size_t budget, SpatialDivision& division, const Token& token);

/// Writes the two sides, of division.left_size and right_size references: first those not cut, in
/// list order, then the parts. `ranks` is scratch.
void divide_space(const ReferenceView& node, const SpatialDivision& division,
                  Array<std::uint32_t>& ranks, const ReferenceTarget& left,
                  const ReferenceTarget& right, const Token& token);

}  // namespace bvhlab
