// SPDX-License-Identifier: GPL-3.0-or-later
// One thread per ray, SIMD lanes over a node's children and a leaf's triangles: the shape for
// devices whose threads have vectors of their own. ANY_HIT: 0 or 1.

kernel void traverse(__global const Node* nodes, __global const float* leaves,
                     __global const uint* triangles,
                     Box bounds,  // of the mesh
                     __global const Ray* rays,
                     __global const uint* order,  // rays in the order in which to trace them
                     uint ordered,                // 0: as they come, without `order`
                     uint first,                  // rays before these were traced
                     uint end,
                     __global Hit* hits,               // by ray; not for any hit
                     __global uchar* occluded,         // by ray; any hit only
                     __global uint* undecided_rays) {  // their number, then the rays
    const uint position = first + (uint)get_global_id(0);
    if (position >= end) return;
    const uint index = ordered ? order[position] : position;
    const Tree tree = {nodes, leaves, triangles};
    const Ray ray = rays[index];
    Stack stack;
    Work work;
    const Hit hit = trace_ray(&tree, &bounds, &ray, ANY_HIT, &stack, &work);
    if (work.undecided)
        undecided_rays[1 + atomic_inc(undecided_rays)] = index;
    else if (ANY_HIT)
        occluded[index] = hit.triangle != NO_TRIANGLE;
    else
        hits[index] = hit;
}
