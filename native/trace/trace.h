// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <string>

#include "base/token.h"
#include "bvh/wide_bvh.h"
#include "trace/ray.h"
#include "trace/reorder.h"

namespace bvhlab {

/// How it is decided whether a ray meets a triangle. All but the first are there to be compared
/// with: float arithmetic as published, which may miss, invent or confuse hits.
enum class TriangleTest {
    watertight,       ///< Woop, Benthin, Wald 2013, decided exactly (intersect.h)
    moller_trumbore,  ///< Moeller, Trumbore 1997, on the original corners
    woop_affine,      ///< Woop 2004: to the unit triangle by a transform of 12 floats
    baldwin_weber     ///< Baldwin, Weber 2016: a transform of 9 floats and a free axis
};
inline constexpr std::array<const char*, 4> triangle_test_names = {"watertight", "moller_trumbore",
                                                                   "woop_affine", "baldwin_weber"};

/// How it is decided whether a ray enters a box.
enum class BoxTest {
    conservative,  ///< Ize 2013: never misses a box that holds a hit (intersect.h)
    plain          ///< slabs as they are rounded: may miss; to compare with
};
inline constexpr std::array<const char*, 2> box_test_names = {"conservative", "plain"};

/// Throw std::invalid_argument naming those that exist.
TriangleTest triangle_test_named(const std::string& name);
BoxTest box_test_named(const std::string& name);

struct TraceOptions {
    bool any_hit = false;            ///< stop at the first hit found; only `occluded` is answered
    Reorder reorder = Reorder::off;  ///< trace in the order of the rays' keys
    bool count = false;              ///< fill node_visits, box_tests, triangle_tests (slower)
    int threads = 0;                 ///< 0: all
    TriangleTest triangle_test = TriangleTest::watertight;
    BoxTest box_test = BoxTest::conservative;
};

/// Traces every ray. With the default tests the answer depends on mesh and ray alone, bit for bit:
/// not on the tree, its branching factor and layout, reordering, SIMD width or threads (see
/// intersect.h for why). With others it depends on the tree too, but not on reordering, SIMD width
/// or threads.
///
/// Tests with a transform make it when they are first used on `bvh` and keep it there: that is
/// `prepare_seconds` of the hits, no part of the traversal's time.
Hits trace(const Bvh& bvh, const RayBatch& rays, const TraceOptions& options, Token& token);

/// The SIMD instruction set that traversal uses on this machine, e.g. "AVX2".
const char* simd_name();

}  // namespace bvhlab
