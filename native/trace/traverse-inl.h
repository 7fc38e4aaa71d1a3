// SPDX-License-Identifier: GPL-3.0-or-later
// Stack-based traversal, one ray at a time, SIMD lanes over a node's children and over a leaf's
// triangles. Compiled once per SIMD target (Highway's -inl.h convention).
//
// A layout is how traversal reads a tree; see FullLayout for the members that one has.
#if defined(BVHLAB_TRACE_TRAVERSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BVHLAB_TRACE_TRAVERSE_INL_H_
#undef BVHLAB_TRACE_TRAVERSE_INL_H_
#else
#define BVHLAB_TRACE_TRAVERSE_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "trace/compressed_layout-inl.h"
#include "trace/full_layout-inl.h"
#include "trace/traverse.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Traversal of one ray through one tree. `Ray` holds what box and triangle test need of a ray.
template <class Layout, class Test, class Ray, bool AnyHit, bool Count>
class Traversal {
public:
    Traversal(const Layout& layout, const Box& bounds, StackEntry* stack)
        : layout_(layout), bounds_(bounds), stack_(stack) {}

    std::uint32_t node_visits = 0, box_tests = 0, triangle_tests = 0;

    Hit closest_or_any(const bvhlab::Ray& given) {
        node_visits = box_tests = triangle_tests = 0;
        const Ray ray(given, bounds_);
        Hit hit{ray.t_max, 0.0F, 0.0F, no_triangle};
        if (!(given.t_min <= given.t_max)) return hit;

        StackEntry* top = stack_;
        StackEntry current = layout_.root(ray.t_min);
        for (;;) {
            if (!layout_.is_leaf(current)) {
                if (descend(ray, hit.t, current, top)) continue;
            } else {
                intersect_leaf(ray, current, hit);
                if (AnyHit && hit.triangle != no_triangle) return hit;
            }
            do {
                if (top == stack_) {
                    if (hit.triangle != no_triangle) {
                        // Denormal numbers are rounded when they are scaled.
                        const float t = float(double(hit.t) * ray.unscale);
                        hit.t = std::clamp(t, given.t_min, given.t_max);
                    }
                    return hit;
                }
                current = *--top;
            } while (!AnyHit && current.urgency > hit.t);
        }
    }

private:
    /// Enters the children of the node `current`: the most urgent becomes `current`, the others go
    /// on the stack, the least urgent first. Returns false where none is entered.
    HWY_INLINE bool descend(const Ray& ray, float t_far, StackEntry& current, StackEntry*& top) {
        const auto& node = layout_.node(current);
        if constexpr (Count) {
            ++node_visits;
            box_tests += Layout::box_count(node);
        }
        HWY_ALIGN float urgency[Layout::width];
        unsigned entered = Layout::template enter<AnyHit>(node, ray, t_far, urgency);
        if (entered == 0) return false;

        unsigned i = unsigned(std::countr_zero(entered));
        current = layout_.child(node, i, urgency[i]);
        entered &= entered - 1;
        StackEntry* const first = top;
        while (entered != 0) {
            i = unsigned(std::countr_zero(entered));
            entered &= entered - 1;
            StackEntry entry = layout_.child(node, i, urgency[i]);
            if (entry.urgency < current.urgency) std::swap(entry, current);
            // The pushed entries stay sorted, the most urgent on top.
            StackEntry* place = top++;
            for (; place != first && place[-1].urgency < entry.urgency; --place) *place = place[-1];
            *place = entry;
        }
        return true;
    }

    HWY_INLINE void intersect_leaf(const Ray& ray, const StackEntry& leaf, Hit& hit) {
        if constexpr (Count) triangle_tests += layout_.triangle_count(leaf);
        layout_.for_each_block(leaf, [&](const auto& lanes, unsigned used) HWY_ATTR {
            Test::template intersect<AnyHit>(lanes, used, ray, hit);
            return AnyHit && hit.triangle != no_triangle;
        });
    }

    const Layout layout_;
    const Box& bounds_;
    StackEntry* stack_;
};

template <class Layout, class Test, class Ray, bool AnyHit, bool Count>
void traverse_share(const TraceTask& task, const Layout& layout) {
    Traversal<Layout, Test, Ray, AnyHit, Count> traversal(layout, task.bvh->mesh->bounds,
                                                          task.stack->data());
    Hits& hits = *task.hits;
    for (std::size_t i = task.begin; i < task.end; ++i) {
        const std::size_t ray = task.order ? task.order[i] : i;
        const Hit hit = traversal.closest_or_any((*task.rays)[ray]);
        const bool found = hit.triangle != no_triangle;
        hits.occluded[ray] = found;
        if constexpr (!AnyHit) {
            hits.t[ray] = found ? hit.t : std::numeric_limits<float>::infinity();
            hits.u[ray] = hit.u;
            hits.v[ray] = hit.v;
            hits.triangle[ray] = hit.triangle;
        }
        if constexpr (Count) {
            hits.node_visits[ray] = traversal.node_visits;
            hits.box_tests[ray] = traversal.box_tests;
            hits.triangle_tests[ray] = traversal.triangle_tests;
        }
    }
}

/// Traverses a share of rays with triangle test `Test` and the box test that `Ray` stands for.
template <class Test, class Ray, class Layout>
void traverse_layout(const TraceTask& task, const Layout& layout) {
    if (task.any_hit)
        task.count ? traverse_share<Layout, Test, Ray, true, true>(task, layout)
                   : traverse_share<Layout, Test, Ray, true, false>(task, layout);
    else
        task.count ? traverse_share<Layout, Test, Ray, false, true>(task, layout)
                   : traverse_share<Layout, Test, Ray, false, false>(task, layout);
}

/// The same for the tree of the task.
template <class Test, class Ray>
void traverse_tree(const TraceTask& task) {
    std::visit(
        [&](const auto& tree) {
            traverse_layout<Test, Ray>(task, layout_of(tree, task.transforms));
        },
        task.bvh->tree);
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#endif  // per target
