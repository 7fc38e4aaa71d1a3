// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bvh/wide_bvh.h"
#include "trace/ray.h"
#include "trace/trace.h"

namespace bvhlab {

/// A child that is still to be visited.
struct StackEntry {
    float
        urgency;  ///< the least is visited first; for the closest hit where the ray enters its box
    std::uint32_t child;  ///< node or first triangle block
    std::uint32_t count;  ///< 0 for a node, else references of the leaf
};

/// A share of a batch for one thread: rays order[begin..end), or begin..end where `order` is null.
struct TraceTask {
    const Bvh* bvh;
    const RayBatch* rays;
    const std::uint32_t* order;
    std::size_t begin, end;
    bool any_hit, count;
    TriangleTest triangle_test;
    BoxTest box_test;
    const TriangleTransforms* transforms;  ///< for tests that need them, else null
    Hits* hits;
    std::vector<StackEntry>* stack;  ///< large enough for the tree's depth: see stack_size()
};

/// Entries that traversal of `bvh` can need: each level leaves at most k - 1 children behind.
inline std::size_t stack_size(const Bvh& bvh) {
    return bvh.max_depth * (bvh.branching() - 1) + bvh.branching();
}

/// Traverses one share with the widest SIMD instructions of this processor.
void traverse(const TraceTask& task);

// The same with one triangle test: a translation unit each, to compile side by side.
void traverse_watertight(const TraceTask& task);
void traverse_watertight_plain(const TraceTask& task);
void traverse_moller_trumbore(const TraceTask& task);
void traverse_woop_affine(const TraceTask& task);
void traverse_baldwin_weber(const TraceTask& task);

}  // namespace bvhlab
