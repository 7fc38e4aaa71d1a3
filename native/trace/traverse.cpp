// SPDX-License-Identifier: GPL-3.0-or-later
// Stack-based traversal of 2-, 4- and 8-wide trees, one ray at a time, SIMD lanes over a node's
// children and over a leaf's triangles. Compiled once per instruction set; the best is chosen at
// run time.
#include "trace/traverse.h"

#include <bit>
#include <limits>

#include "trace/intersect.h"
#include "trace/trace.h"

// SSE2, SSE4, AVX2 and AVX-512 differ for this code; the targets between them do not.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace/traverse.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Bit i set where lane i of the mask is.
template <class D, class M>
unsigned mask_bits(D d, M mask) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, mask, bits);
    return bits[0];
}

/// Bit i of the result is set where the ray enters child i of the node no farther than `t_far`;
/// `urgency[i]` then says which child comes first, the least: the distance at which its box is
/// entered, or, for any hit, minus the distance at which it is left. The nearest boxes hold the
/// surroundings of the ray's origin, which seldom block it: on the diffuse rays of crytek_sponza,
/// farthest first visits a third of the nodes.
template <unsigned K, bool AnyHit>
HWY_INLINE unsigned enter_children(const WideNode<K>& node, const PreparedRay& ray, float t_far,
                                   float (&urgency)[K]) {
    const hn::CappedTag<float, K> d;
    const auto distance = [&](int plane, float origin, float inverse, unsigned i) {
        return hn::Mul(hn::Sub(hn::Load(d, node.planes[plane] + i), hn::Set(d, origin)),
                       hn::Set(d, inverse));
    };
    unsigned entered = 0;
    for (unsigned i = 0; i < K; i += unsigned(hn::Lanes(d))) {
        const auto near_x = distance(ray.near_plane[0], ray.near_origin.x, ray.near_inverse.x, i);
        const auto near_y = distance(ray.near_plane[1], ray.near_origin.y, ray.near_inverse.y, i);
        const auto near_z = distance(ray.near_plane[2], ray.near_origin.z, ray.near_inverse.z, i);
        const auto far_x = distance(ray.far_plane[0], ray.far_origin.x, ray.far_inverse.x, i);
        const auto far_y = distance(ray.far_plane[1], ray.far_origin.y, ray.far_inverse.y, i);
        const auto far_z = distance(ray.far_plane[2], ray.far_origin.z, ray.far_inverse.z, i);
        const auto enter = hn::Max(hn::Max(near_x, near_y), hn::Max(near_z, hn::Set(d, ray.t_min)));
        const auto leave = hn::Min(hn::Min(far_x, far_y), hn::Min(far_z, hn::Set(d, t_far)));
        hn::Store(AnyHit ? hn::Neg(leave) : enter, d, urgency + i);
        entered |= mask_bits(d, hn::Le(enter, leave)) << i;
    }
    return entered;
}

/// Bit i set where triangle i of the block may be met: its edge functions in float do not differ in
/// sign by more than their error. With e = projection_error the bound on a projected coordinate's
/// error (its terms are below 6u * reach) and p the largest projected coordinate, an edge function
/// errs by less than 4 e p + 2 e^2 + 4 u p^2; the smallest normal float covers underflow. Overflow
/// yields infinities or NaN, for which the comparisons are false and the triangle is kept.
template <unsigned Lanes>
HWY_INLINE unsigned may_meet(const TriangleBlock<Lanes>& block, const PreparedRay& ray) {
    const hn::CappedTag<float, Lanes> d;
    using V = hn::Vec<decltype(d)>;
    const V origin_x = hn::Set(d, ray.origin[ray.kx]);
    const V origin_y = hn::Set(d, ray.origin[ray.ky]);
    const V origin_z = hn::Set(d, ray.origin[ray.kz]);
    const V shear_x = hn::Set(d, ray.shear_x), shear_y = hn::Set(d, ray.shear_y);
    const float error = ray.projection_error;
    unsigned kept = 0;
    for (unsigned i = 0; i < Lanes; i += unsigned(hn::Lanes(d))) {
        const auto project = [&](int corner, V& x, V& y) {
            const V z = hn::Sub(hn::Load(d, block.corners[corner][ray.kz] + i), origin_z);
            x = hn::Sub(hn::Sub(hn::Load(d, block.corners[corner][ray.kx] + i), origin_x),
                        hn::Mul(shear_x, z));
            y = hn::Sub(hn::Sub(hn::Load(d, block.corners[corner][ray.ky] + i), origin_y),
                        hn::Mul(shear_y, z));
        };
        V ax, ay, bx, by, cx, cy;
        project(0, ax, ay);
        project(1, bx, by);
        project(2, cx, cy);
        const V a = hn::Sub(hn::Mul(cx, by), hn::Mul(cy, bx));
        const V b = hn::Sub(hn::Mul(ax, cy), hn::Mul(ay, cx));
        const V c = hn::Sub(hn::Mul(bx, ay), hn::Mul(by, ax));

        const V px = hn::Max(hn::Abs(ax), hn::Max(hn::Abs(bx), hn::Abs(cx)));
        const V py = hn::Max(hn::Abs(ay), hn::Max(hn::Abs(by), hn::Abs(cy)));
        const V p = hn::Max(px, py);
        const V bound = hn::Add(
            hn::Mul(hn::Add(hn::Set(d, 4.0F * error), hn::Mul(hn::Set(d, 8.0F * 0x1p-24F), p)), p),
            hn::Set(d, 2.0F * error * error + std::numeric_limits<float>::min()));
        const V least = hn::Min(a, hn::Min(b, c));
        const V most = hn::Max(a, hn::Max(b, c));
        const auto apart = hn::And(hn::Lt(least, hn::Neg(bound)), hn::Gt(most, bound));
        kept |= (~mask_bits(d, apart) & ((1U << hn::Lanes(d)) - 1U)) << i;
    }
    return kept;
}

/// Traversal of one ray through one tree.
template <unsigned K, bool AnyHit, bool Count>
class Traversal {
public:
    static constexpr unsigned lanes = WideBvh<K>::lanes;

    Traversal(const WideBvh<K>& tree, const Box& bounds, StackEntry* stack)
        : tree_(tree), bounds_(bounds), stack_(stack) {}

    std::uint32_t node_visits = 0, box_tests = 0, triangle_tests = 0;

    Hit closest_or_any(const Ray& given) {
        node_visits = box_tests = triangle_tests = 0;
        const PreparedRay ray(given, bounds_);
        Hit hit{ray.t_max, 0.0F, 0.0F, no_triangle};
        if (!(ray.t_min <= ray.t_max)) return hit;

        StackEntry* top = stack_;
        StackEntry current{ray.t_min, 0, 0};
        for (;;) {
            if (current.count == 0) {
                if (descend(ray, hit.t, current, top)) continue;
            } else {
                intersect_leaf(ray, current, hit);
                if (AnyHit && hit.triangle != no_triangle) return hit;
            }
            do {
                if (top == stack_) {
                    if (hit.triangle != no_triangle) hit.t = float(double(hit.t) * ray.unscale);
                    return hit;
                }
                current = *--top;
            } while (!AnyHit && current.urgency > hit.t);
        }
    }

private:
    /// Enters the children of node `current.child`: the most urgent becomes `current`, the others
    /// go on the stack, the least urgent first. Returns false where none is entered.
    HWY_INLINE bool descend(const PreparedRay& ray, float t_far, StackEntry& current,
                            StackEntry*& top) {
        const WideNode<K>& node = tree_.nodes[current.child];
        if constexpr (Count) {
            ++node_visits;
            for (unsigned i = 0; i < K; ++i) box_tests += !node.is_missing(i);
        }
        HWY_ALIGN float urgency[K];
        unsigned entered = enter_children<K, AnyHit>(node, ray, t_far, urgency);
        if (entered == 0) return false;

        unsigned i = unsigned(std::countr_zero(entered));
        current = {urgency[i], node.child[i], node.count[i]};
        entered &= entered - 1;
        StackEntry* const first = top;
        while (entered != 0) {
            i = unsigned(std::countr_zero(entered));
            entered &= entered - 1;
            StackEntry entry{urgency[i], node.child[i], node.count[i]};
            if (entry.urgency < current.urgency) std::swap(entry, current);
            // The pushed entries stay sorted, the most urgent on top.
            StackEntry* place = top++;
            for (; place != first && place[-1].urgency < entry.urgency; --place) *place = place[-1];
            *place = entry;
        }
        return true;
    }

    HWY_INLINE void intersect_leaf(const PreparedRay& ray, const StackEntry& leaf, Hit& hit) {
        if constexpr (Count) triangle_tests += leaf.count;
        for (std::uint32_t first = 0; first < leaf.count; first += lanes) {
            const TriangleBlock<lanes>& block = tree_.blocks[leaf.child + first / lanes];
            const std::uint32_t used = std::min(leaf.count - first, std::uint32_t(lanes));
            for (unsigned kept = may_meet<lanes>(block, ray) & ((1U << used) - 1U); kept != 0;
                 kept &= kept - 1) {
                intersect_lane(ray, block, unsigned(std::countr_zero(kept)), hit);
                if (AnyHit && hit.triangle != no_triangle) return;
            }
        }
    }

    static void intersect_lane(const PreparedRay& ray, const TriangleBlock<lanes>& block,
                               unsigned lane, Hit& hit) {
        float corners[3][3];
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis)
                corners[corner][axis] = block.corners[corner][axis][lane];
        float t, u, v;
        if (!meets_triangle(ray, corners, t, u, v)) return;
        const std::uint32_t triangle = block.triangle[lane];
        if (t < hit.t || (t == hit.t && triangle < hit.triangle)) hit = {t, u, v, triangle};
    }

    const WideBvh<K>& tree_;
    const Box& bounds_;
    StackEntry* stack_;
};

template <unsigned K, bool AnyHit, bool Count>
void traverse_share(const TraceTask& task, const WideBvh<K>& tree) {
    Traversal<K, AnyHit, Count> traversal(tree, task.bvh->mesh->bounds, task.stack->data());
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

template <unsigned K>
void traverse_tree(const TraceTask& task, const WideBvh<K>& tree) {
    if (task.any_hit)
        task.count ? traverse_share<K, true, true>(task, tree)
                   : traverse_share<K, true, false>(task, tree);
    else
        task.count ? traverse_share<K, false, true>(task, tree)
                   : traverse_share<K, false, false>(task, tree);
}

void traverse_task(const TraceTask& task) {
    std::visit([&](const auto& tree) { traverse_tree(task, tree); }, task.bvh->tree);
}

const char* target_name() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(traverse_task);
HWY_EXPORT(target_name);

void traverse(const TraceTask& task) {
    HWY_DYNAMIC_DISPATCH(traverse_task)(task);
}

const char* simd_name() {
    return HWY_DYNAMIC_DISPATCH(target_name)();
}

}  // namespace bvhlab
#endif
