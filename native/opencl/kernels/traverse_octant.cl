// SPDX-License-Identifier: GPL-3.0-or-later
// Compressed nodes on GPUs (Ylitie, Karras, Laine 2017, section 3.2): one thread per ray, children
// in the order of their slots as the ray's octant has it, without sorting distances, and a stack of
// nodes with the children that are left rather than of children: at most one entry a level.
// ANY_HIT: 0 or 1. OCTANT_STACK: entries; a deeper tree's rays may be left undecided.

/// A node and those of its interior children that are still to be visited, a bit for each slot in
/// the ray's order, the highest first.
typedef struct {
    uint node;
    uint children;
} NodeGroup;

/// Bit i of the result is bit i ^ flip of the 8 bits given.
inline uint flipped(uint bits, uint flip) {
    if (flip & 1U) bits = (bits & 0x55U) << 1 | (bits >> 1 & 0x55U);
    if (flip & 2U) bits = (bits & 0x33U) << 2 | (bits >> 2 & 0x33U);
    if (flip & 4U) bits = (bits & 0x0FU) << 4 | bits >> 4;
    return bits;
}

inline uint highest_bit(uint bits) {
    return 31 - clz(bits);
}

/// Falling order of slot ^ flip is that in which the ray meets slots (bvh/octant_slots.h); for any
/// hit the other way round, as what is near the origin seldom blocks a ray.
inline uint flip_of(const PreparedRay* ray) {
    const uint signs =
        ray->slab[0].negative << 2 | ray->slab[1].negative << 1 | ray->slab[2].negative;
    return ANY_HIT ? signs : signs ^ 7U;
}

/// Intersects the leaves among the children that the ray enters. False where a triangle is
/// undecided.
inline bool visit_leaves(const Tree* tree, const PreparedRay* ray, const Ray* given, uint node,
                         uint leaves, uint flip, Hit* hit) {
    while (leaves != 0) {
        const uint place = highest_bit(leaves);
        leaves &= ~(1U << place);
        const StackEntry leaf = child_of(tree, node, place ^ flip, 0.0F);
        if (!intersect_leaf(tree, ray, given, &leaf, ANY_HIT, hit)) return false;
        if (ANY_HIT && hit->triangle != NO_TRIANGLE) return true;
    }
    return true;
}

/// The closest hit, or any; `decided` says whether it is one.
inline Hit trace_octants(const Tree* tree, const Box* bounds, const Ray* given, bool* decided) {
    *decided = true;
    Hit hit = {INFINITY, 0.0F, 0.0F, NO_TRIANGLE};
    if (!(given->t_min <= given->t_max)) return hit;
    const PreparedRay ray = prepared(given, bounds);
    const uint flip = flip_of(&ray);
    hit.t = ray.t_max;
    NodeGroup stack[OCTANT_STACK];
    uint top = 0, node = 0;
    for (;;) {
        float8 distances;
        const uint entered = enter_node(tree, node, &ray, hit.t, ANY_HIT, &distances);
        const uint mask = tree->nodes[node].interior_mask;
        *decided =
            visit_leaves(tree, &ray, given, node, flipped(entered & ~mask, flip), flip, &hit);
        if (!*decided || (ANY_HIT && hit.triangle != NO_TRIANGLE)) return hit;
        NodeGroup group = {node, flipped(entered & mask, flip)};
        while (group.children == 0) {
            if (top == 0) {
                finish_hit(given, ray.unscale, &hit);
                return hit;
            }
            group = stack[--top];
        }
        const uint place = highest_bit(group.children);
        group.children &= ~(1U << place);
        if (group.children != 0) {
            if (top == OCTANT_STACK) break;
            stack[top++] = group;
        }
        node = child_of(tree, group.node, place ^ flip, 0.0F).child;
    }
    *decided = false;
    return hit;
}

kernel void traverse_octant(TRACE_ARGUMENTS) {
    const uint position = first + (uint)get_global_id(0);
    if (position >= end) return;
    const uint index = ordered ? order[position] : position;
    const Tree tree = {nodes, leaves, triangles};
    const Ray ray = rays[index];
    bool decided;
    const Hit hit = trace_octants(&tree, &bounds, &ray, &decided);
    put_answer(index, hit, decided, hits, occluded, undecided_rays);
}
