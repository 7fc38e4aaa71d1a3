// SPDX-License-Identifier: GPL-3.0-or-later
// Traversal with the default tests, compiled once per instruction set.
#include "trace/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace/traverse_watertight.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include "trace/traverse-inl.h"
#include "trace/triangles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {

void watertight_task(const TraceTask& task) {
    traverse_tree<Watertight, PreparedRay>(task);
}

const char* target_name() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(watertight_task);
HWY_EXPORT(target_name);

void traverse_watertight(const TraceTask& task) {
    HWY_DYNAMIC_DISPATCH(watertight_task)(task);
}

const char* simd_name() {
    return HWY_DYNAMIC_DISPATCH(target_name)();
}

}  // namespace bvhlab
#endif
