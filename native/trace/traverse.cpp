// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/traverse.h"

#include <hwy/targets.h>

namespace bvhlab {

void traverse(const TraceTask& task) {
    switch (task.triangle_test) {
        case TriangleTest::watertight:
            return task.box_test == BoxTest::plain ? traverse_watertight_plain(task)
                                                   : traverse_watertight(task);
        case TriangleTest::moller_trumbore:
            return traverse_moller_trumbore(task);
        case TriangleTest::woop_affine:
            return traverse_woop_affine(task);
        case TriangleTest::baldwin_weber:
            return traverse_baldwin_weber(task);
    }
}

}  // namespace bvhlab
