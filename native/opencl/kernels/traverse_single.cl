// SPDX-License-Identifier: GPL-3.0-or-later
// One thread per ray, SIMD lanes over a node's children and a leaf's triangles: the shape for
// devices whose threads have vectors of their own. ANY_HIT: 0 or 1.

kernel void traverse(TRACE_ARGUMENTS) {
    const uint position = first + (uint)get_global_id(0);
    if (position >= end) return;
    const uint index = ordered ? order[position] : position;
    const Tree tree = {nodes, leaves, triangles};
    const Ray ray = rays[index];
    Stack stack;
    Work work;
    const Hit hit = trace_ray(&tree, &bounds, &ray, ANY_HIT, &stack, &work);
    put_answer(index, hit, !work.undecided, hits, occluded, undecided_rays);
}
