// SPDX-License-Identifier: GPL-3.0-or-later
// One thread per ray for the rays that traverse_single.cl left undecided, and for those whose work
// is counted: decisions without rounding, and a stack that spills. Built with CAREFUL.

kernel void traverse_carefully(__global const Node* nodes, __global const float* leaves,
                               __global const uint* triangles,
                               Box bounds,  // of the mesh
                               __global const Ray* rays,
                               __global const uint* order,  // rays in the order to trace them in
                               uint order_first,            // where they begin in `order`
                               uint ordered,                // 0: as they come, without `order`
                               uint first,                  // rays before these were traced
                               uint end, uint any_hit,
                               __global Hit* hits,        // by ray; not for any hit
                               __global uchar* occluded,  // by ray; any hit only
                               uint counted,              // 0: without the next three
                               __global uint* node_visits, __global uint* box_tests,
                               __global uint* triangle_tests,
                               __global StackEntry* spilled,  // for each work-item:
                               uint spill_capacity) {
    const uint position = first + (uint)get_global_id(0);
    if (position >= end) return;
    const uint index = ordered ? order[order_first + position] : position;
    const Tree tree = {nodes, leaves, triangles};
    const Ray ray = rays[index];
    Stack stack;
    stack.spilled = spilled + (size_t)spill_capacity * get_global_id(0);
    stack.spilled_count = 0;
    Work work;
    const Hit hit = trace_ray(&tree, &bounds, &ray, any_hit != 0, &stack, &work);
    if (any_hit)
        occluded[index] = hit.triangle != NO_TRIANGLE;
    else
        hits[index] = hit;
    if (!counted) return;
    node_visits[index] = work.node_visits;
    box_tests[index] = work.box_tests;
    triangle_tests[index] = work.triangle_tests;
}
