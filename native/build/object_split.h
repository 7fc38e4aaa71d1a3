// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <limits>
#include <utility>

#include "base/token.h"
#include "build/reference_set.h"
#include "scene/mesh.h"

namespace bvhlab {

/// Centre by which references are ordered on an axis, doubled.
inline float doubled_centre(const Reference& reference, int axis) {
    return reference.box.lower[axis] + reference.box.upper[axis];
}

/// One whole reference per triangle, sorted by centre on the three axes; ties in the mesh's order.
/// Throws Cancelled.
ReferenceSet sorted_references(const Mesh& mesh, const Token& token);

/// A division of a node's references: the first `left_size` in the order of `axis` go to the left.
struct ObjectSplit {
    /// Half areas of the two boxes, each times its number of references.
    double cost = std::numeric_limits<double>::infinity();
    int axis = 0;
    std::size_t left_size = 0;
};

/// The division of least cost among all 3 (n - 1), for n >= 2 references. Equal costs are decided
/// by the more even sizes, then axis x before y before z, then the smaller left side. References
/// whose centres are all the same are divided evenly.
ObjectSplit find_object_split(const ReferenceView& node, const Token& token);

/// Boxes of the two sides.
std::pair<Box, Box> side_boxes(const ReferenceView& node, const ObjectSplit& split,
                               const Token& token);

/// Writes the two sides, of split.left_size and the remaining references. The references are put in
/// the order of the split's axis; `ranks` is scratch.
void divide_objects(const ReferenceView& node, const ObjectSplit& split,
                    Array<std::uint32_t>& ranks, const ReferenceTarget& left,
                    const ReferenceTarget& right, const Token& token);

}  // namespace bvhlab
