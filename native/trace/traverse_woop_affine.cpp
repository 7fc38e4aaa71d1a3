// SPDX-License-Identifier: GPL-3.0-or-later
// Traversal with the affine test of Woop, compiled once per instruction set.
#include "trace/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace/traverse_woop_affine.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include "trace/plain_ray.h"
#include "trace/published_tests-inl.h"
#include "trace/traverse-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {

void woop_affine_task(const TraceTask& task) {
    task.box_test == BoxTest::plain ? traverse_tree<WoopAffine, PlainRay>(task)
                                    : traverse_tree<WoopAffine, BoxRay>(task);
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(woop_affine_task);

void traverse_woop_affine(const TraceTask& task) {
    HWY_DYNAMIC_DISPATCH(woop_affine_task)(task);
}

}  // namespace bvhlab
#endif
