// SPDX-License-Identifier: GPL-3.0-or-later
// Traversal with the watertight triangle test and plain boxes, compiled once per instruction set.
#include "trace/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace/traverse_watertight_plain.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, which includes this file again for each target.
#include "trace/plain_ray.h"
#include "trace/traverse-inl.h"
#include "trace/triangles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bvhlab {
namespace HWY_NAMESPACE {

void watertight_plain_task(const TraceTask& task) {
    traverse_tree<Watertight, PlainPreparedRay>(task);
}

}  // namespace HWY_NAMESPACE
}  // namespace bvhlab
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bvhlab {

HWY_EXPORT(watertight_plain_task);

void traverse_watertight_plain(const TraceTask& task) {
    HWY_DYNAMIC_DISPATCH(watertight_plain_task)(task);
}

}  // namespace bvhlab
#endif
