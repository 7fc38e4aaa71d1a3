// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/token.h"
#include "bvh/wide_bvh.h"
#include "trace/ray.h"
#include "trace/reorder.h"

namespace bvhlab {

struct TraceOptions {
    bool any_hit = false;            ///< stop at the first hit found; only `occluded` is answered
    Reorder reorder = Reorder::off;  ///< trace in the order of the rays' keys
    bool count = false;              ///< fill node_visits, box_tests, triangle_tests (slower)
    int threads = 0;                 ///< 0: all
};

/// Traces every ray. The answer depends on mesh and ray alone, bit for bit: not on the tree, its
/// branching factor, reordering, SIMD width or threads (see intersect.h for why).
Hits trace(const Bvh& bvh, const RayBatch& rays, const TraceOptions& options, Token& token);

/// The SIMD instruction set that traversal uses on this machine, e.g. "AVX2".
const char* simd_name();

}  // namespace bvhlab
