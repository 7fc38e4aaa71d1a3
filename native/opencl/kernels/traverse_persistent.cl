// SPDX-License-Identifier: GPL-3.0-or-later
// Binary trees on GPUs: while-while with persistent threads (Aila, Laine 2009), each of which takes
// the next ray as soon as its own has ended (dynamic fetch: Aila, Laine, Karras 2012), and a leaf
// that is postponed while there are nodes to visit. ANY_HIT: 0 or 1.
//
// A thread visits nodes until it holds two leaves; without votes among threads of unknown width
// that stands for the vote which ends the node phase there.

/// What a thread is busy with.
typedef struct {
    uint index;  // of the ray
    Ray given;
    PreparedRay ray;
    Hit hit;
    StackEntry current;  // node or leaf to go on with
    bool more;           // `current` is there
} Task;

/// The next entry that may matter; false where there is none.
inline bool next_entry(Stack* stack, const Hit* hit, StackEntry* current) {
    do {
        if (!pop(stack, current)) return false;
    } while (!ANY_HIT && current->urgency > hit->t);
    return true;
}

inline void begin(Task* task, const Box* bounds, Stack* stack) {
    task->hit = (Hit){INFINITY, 0.0F, 0.0F, NO_TRIANGLE};
    task->more = task->given.t_min <= task->given.t_max;
    if (!task->more) return;
    task->ray = prepared(&task->given, bounds);
    task->hit.t = task->ray.t_max;
    task->current = (StackEntry){task->ray.t_min, 0, 0};
    stack->top = 0;
}

/// Visits nodes until the task ends in a second leaf or in nothing; the first leaf is `postponed`.
/// False where the stack has no room.
inline bool visit_nodes(const Tree* tree, Task* task, Stack* stack, StackEntry* postponed) {
    while (task->more && task->current.count == 0) {
        if (!has_room(stack)) return false;
        if (!descend(tree, &task->ray, task->hit.t, ANY_HIT, &task->current, stack))
            task->more = next_entry(stack, &task->hit, &task->current);
        if (task->more && task->current.count != 0 && postponed->count == 0) {
            *postponed = task->current;
            task->more = next_entry(stack, &task->hit, &task->current);
        }
    }
    return true;
}

/// Intersects the postponed leaf and those that follow it. False where a triangle is undecided.
inline bool visit_leaves(const Tree* tree, Task* task, Stack* stack, StackEntry* postponed) {
    while (postponed->count != 0) {
        if (!intersect_leaf(tree, &task->ray, &task->given, postponed, ANY_HIT, &task->hit))
            return false;
        postponed->count = 0;
        if (ANY_HIT && task->hit.triangle != NO_TRIANGLE) task->more = false;
        if (task->more && task->current.count != 0) {
            *postponed = task->current;
            task->more = next_entry(stack, &task->hit, &task->current);
        }
    }
    return true;
}

kernel void traverse_persistent(__global const Node* nodes, __global const float* leaves,
                                __global const uint* triangles,
                                Box bounds,  // of the mesh
                                __global const Ray* rays,
                                __global const uint* order,  // rays in the order to trace them in
                                uint ordered,                // 0: as they come, without `order`
                                uint first,                  // rays before these were traced
                                uint end,
                                __global Hit* hits,             // by ray; not for any hit
                                __global uchar* occluded,       // by ray; any hit only
                                __global uint* undecided_rays,  // their number, then the rays
                                __global uint* fetched) {       // rays taken, 0 at first
    const Tree tree = {nodes, leaves, triangles};
    Stack stack;
    Task task;
    StackEntry postponed = {0.0F, 0, 0};
    bool busy = false;
    for (;;) {
        if (!busy) {
            const uint taken = atomic_inc(fetched);
            if (taken >= end - first) return;
            task.index = ordered ? order[first + taken] : first + taken;
            task.given = rays[task.index];
            begin(&task, &bounds, &stack);
            busy = true;
        }
        bool decided = visit_nodes(&tree, &task, &stack, &postponed);
        decided = decided && visit_leaves(&tree, &task, &stack, &postponed);
        if (decided && task.more) continue;
        busy = false;
        postponed.count = 0;
        if (!decided) {
            undecided_rays[1 + atomic_inc(undecided_rays)] = task.index;
        } else if (ANY_HIT) {
            occluded[task.index] = task.hit.triangle != NO_TRIANGLE;
        } else {
            finish_hit(&task.given, task.ray.unscale, &task.hit);
            hits[task.index] = task.hit;
        }
    }
}
