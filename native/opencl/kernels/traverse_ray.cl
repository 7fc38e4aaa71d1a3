// SPDX-License-Identifier: GPL-3.0-or-later
// Traversal of one ray by one thread, as trace/traverse-inl.h: the same nodes in the same order,
// so work counts are the host's. A node layout's file stands before this.
//
// STACK_SIZE: entries of the stack in private memory. Where a deep tree needs more, a program built
// with CAREFUL moves the older half to global memory and gets it back when it is needed; any other
// answers that it is undecided.

/// What tracing a ray took.
typedef struct {
    bool undecided;  // the hit is not known: trace the ray with a CAREFUL program
    uint node_visits, box_tests, triangle_tests;
} Work;

typedef struct {
    StackEntry entries[STACK_SIZE];
    uint top;
#ifdef CAREFUL
    __global StackEntry* spilled;  // room for all that the tree's depth can need
    uint spilled_count;
#endif
} Stack;

// --- stack --------------------------------------------------------------------------------------

/// Makes room for the children of a node; false where there is none.
inline bool has_room(Stack* stack) {
    if (stack->top + WIDTH <= STACK_SIZE) return true;
#ifdef CAREFUL
    for (uint i = 0; i < STACK_SIZE / 2; ++i)
        stack->spilled[stack->spilled_count + i] = stack->entries[i];
    for (uint i = STACK_SIZE / 2; i < stack->top; ++i)
        stack->entries[i - STACK_SIZE / 2] = stack->entries[i];
    stack->spilled_count += STACK_SIZE / 2;
    stack->top -= STACK_SIZE / 2;
    return true;
#else
    return false;
#endif
}

/// False where nothing is left to be visited.
inline bool pop(Stack* stack, StackEntry* entry) {
#ifdef CAREFUL
    if (stack->top == 0 && stack->spilled_count != 0) {
        stack->spilled_count -= STACK_SIZE / 2;
        for (uint i = 0; i < STACK_SIZE / 2; ++i)
            stack->entries[i] = stack->spilled[stack->spilled_count + i];
        stack->top = STACK_SIZE / 2;
    }
#endif
    if (stack->top == 0) return false;
    *entry = stack->entries[--stack->top];
    return true;
}

// --- nodes --------------------------------------------------------------------------------------

/// Enters the children of the node `current`: the most urgent becomes `current`, the others go on
/// the stack, the least urgent first. False where none is entered.
inline bool descend(const Tree* tree, const PreparedRay* ray, float t_far, bool any_hit,
                    StackEntry* current, Stack* stack) {
    FLOATS distances;
    const uint node = current->child;
    uint entered = enter_node(tree, node, ray, t_far, any_hit, &distances);
    if (entered == 0) return false;
    float urgency[WIDTH];
    JOIN(vstore, WIDTH)(distances, 0, urgency);

    uint i = lowest_bit(entered);
    *current = child_of(tree, node, i, urgency[i]);
    const uint first = stack->top;
    for (entered &= entered - 1; entered != 0; entered &= entered - 1) {
        i = lowest_bit(entered);
        StackEntry entry = child_of(tree, node, i, urgency[i]);
        if (entry.urgency < current->urgency) {
            const StackEntry nearer = entry;
            entry = *current;
            *current = nearer;
        }
        // The pushed entries stay sorted, the most urgent on top.
        uint place = stack->top++;
        for (; place != first && stack->entries[place - 1].urgency < entry.urgency; --place)
            stack->entries[place] = stack->entries[place - 1];
        stack->entries[place] = entry;
    }
    return true;
}

// --- leaves -------------------------------------------------------------------------------------

/// Lets a leaf's triangles compete for `hit`; equal t is decided by the lower index. False where
/// one is undecided.
inline bool intersect_leaf(const Tree* tree, const PreparedRay* ray, const Ray* given,
                           const StackEntry* leaf, bool any_hit, Hit* hit) {
    for (uint first = 0; first < leaf->count; first += LANES) {
        const Block block = block_of(tree, leaf, first);
        uint kept = may_meet(ray, block.rows, block.stride) & ((1U << block.used) - 1U);
        for (; kept != 0; kept &= kept - 1) {
            const uint lane = lowest_bit(kept);
            Hit found;
            const Meeting meeting =
                meets_triangle(ray, given, block.rows + lane, block.stride, hit->t, &found);
            if (meeting == undecided) return false;
            if (meeting == missed) continue;
            found.triangle = block.triangles[lane];
            if (found.t < hit->t || (found.t == hit->t && found.triangle < hit->triangle))
                *hit = found;
            if (any_hit && hit->triangle != NO_TRIANGLE) return true;
        }
    }
    return true;
}

// --- rays ---------------------------------------------------------------------------------------

/// The caller's t; denormal numbers are rounded when they are scaled. A miss has t = infinity.
inline void finish_hit(const Ray* given, double unscale, Hit* hit) {
    if (hit->triangle == NO_TRIANGLE) {
        hit->t = INFINITY;
        return;
    }
    const float t = (float)((double)hit->t * unscale);
    hit->t = t < given->t_min ? given->t_min : given->t_max < t ? given->t_max : t;
}

/// The closest hit, or any.
inline Hit trace_ray(const Tree* tree, const Box* bounds, const Ray* given, bool any_hit,
                     Stack* stack, Work* work) {
    *work = (Work){false, 0, 0, 0};
    Hit hit = {INFINITY, 0.0F, 0.0F, NO_TRIANGLE};
    if (!(given->t_min <= given->t_max)) return hit;
    const PreparedRay ray = prepared(given, bounds);
    hit.t = ray.t_max;
    stack->top = 0;
    StackEntry current = {ray.t_min, 0, 0};
    for (;;) {
        if (current.count == 0) {
#ifdef CAREFUL
            ++work->node_visits;
            work->box_tests += box_count(tree, current.child);
#endif
            if (!has_room(stack)) break;
            if (descend(tree, &ray, hit.t, any_hit, &current, stack)) continue;
        } else {
#ifdef CAREFUL
            work->triangle_tests += current.count;
#endif
            if (!intersect_leaf(tree, &ray, given, &current, any_hit, &hit)) break;
            if (any_hit && hit.triangle != NO_TRIANGLE) return hit;
        }
        do {
            if (!pop(stack, &current)) {
                finish_hit(given, ray.unscale, &hit);
                return hit;
            }
        } while (!any_hit && current.urgency > hit.t);
    }
    work->undecided = true;
    return hit;
}

// --- kernels of all shapes ----------------------------------------------------------------------
#ifndef CAREFUL

/// Their first arguments:
///   nodes, leaves, triangles  of the tree
///   bounds                    of the mesh
///   rays, order               rays in the order in which to trace them, if `ordered` is not 0
///   first, end                positions to trace
///   hits                      by ray; not for any hit
///   occluded                  by ray; any hit only
///   undecided_rays            their number, then the rays
#define TRACE_ARGUMENTS                                                                       \
    __global const Node *nodes, __global const float *leaves, __global const uint *triangles, \
        Box bounds, __global const Ray *rays, __global const uint *order, uint ordered,       \
        uint first, uint end, __global Hit *hits, __global uchar *occluded,                   \
        __global uint *undecided_rays

/// A ray's answer, or that it has none.
inline void put_answer(uint ray, Hit hit, bool decided, __global Hit* hits,
                       __global uchar* occluded, __global uint* undecided_rays) {
    if (!decided)
        undecided_rays[1 + atomic_inc(undecided_rays)] = ray;
    else if (ANY_HIT)
        occluded[ray] = hit.triangle != NO_TRIANGLE;
    else
        hits[ray] = hit;
}

#endif
