// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>

#include "base/array.h"

namespace bvhlab {

/// A tree's triangles made ready for one triangle test (trace/transforms.h): `per_triangle` floats
/// each, in rows as the tree holds their corners. Where n corners stand in a row, first those of
/// reference f, value k of lane i is values[per_triangle * f + k * n + i].
struct TriangleTransforms {
    std::size_t per_triangle = 0;
    Array<float> values;

    std::size_t bytes() const { return values.size() * sizeof(float); }
};

/// What tracing has made ready for a tree, kept for the next call. Null until it is first asked
/// for. Several threads may trace the same tree.
struct TransformCache {
    std::mutex mutex;  ///< guards the pointers, not what they point to
    std::shared_ptr<const TriangleTransforms> woop_affine, baldwin_weber;
};

}  // namespace bvhlab
