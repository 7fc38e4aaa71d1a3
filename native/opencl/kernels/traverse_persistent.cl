// SPDX-License-Identifier: GPL-3.0-or-later
// Binary trees on GPUs: while-while with persistent threads (Aila, Laine 2009), each of which takes
// the next ray as soon as its own has ended (dynamic fetch: Aila, Laine, Karras 2012), and a leaf
// that is postponed while there are nodes to visit. ANY_HIT: 0 or 1.
//
// With sub-groups their threads take rays together, and vote: nodes are visited while one of them
// has yet to find a leaf. Without, a thread visits nodes until it holds two leaves.

/// What a thread is busy with.
typedef struct {
    uint index;  // of the ray
    Ray given;
    PreparedRay ray;
    Hit hit;
    StackEntry current;    // node or leaf to go on with
    bool more;             // `current` is there
    StackEntry postponed;  // leaf to be intersected; of no references where there is none
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

/// Whether nodes are to be visited, by this thread or another that votes.
inline bool visits_nodes(const Task* task) {
#ifdef HAS_SUB_GROUPS
    return vote(task->more && task->postponed.count == 0);
#else
    return task->more && task->current.count == 0;
#endif
}

/// Visits the current node unless it is a second leaf; the first is postponed. False where the
/// stack has no room.
inline bool visit_node(const Tree* tree, Task* task, Stack* stack) {
    if (!task->more || task->current.count != 0) return true;
    if (!has_room(stack)) {
        task->more = false;
        return false;
    }
    if (!descend(tree, &task->ray, task->hit.t, ANY_HIT, &task->current, stack))
        task->more = next_entry(stack, &task->hit, &task->current);
    if (task->more && task->current.count != 0 && task->postponed.count == 0) {
        task->postponed = task->current;
        task->more = next_entry(stack, &task->hit, &task->current);
    }
    return true;
}

/// Intersects the postponed leaf and those that follow it. False where a triangle is undecided.
inline bool visit_leaves(const Tree* tree, Task* task, Stack* stack) {
    while (task->postponed.count != 0) {
        if (!intersect_leaf(tree, &task->ray, &task->given, &task->postponed, ANY_HIT, &task->hit))
            return false;
        task->postponed.count = 0;
        if (ANY_HIT && task->hit.triangle != NO_TRIANGLE) task->more = false;
        if (task->more && task->current.count != 0) {
            task->postponed = task->current;
            task->more = next_entry(stack, &task->hit, &task->current);
        }
    }
    return true;
}

kernel void traverse_persistent(TRACE_ARGUMENTS,
                                __global uint* fetched) {  // rays taken, 0 at first
    const Tree tree = {nodes, leaves, triangles};
    Stack stack;
    Task task;
    task.more = false;
    task.postponed.count = 0;
    bool busy = false, over = false, works;
    do {
        // Threads without a ray take the next.
        const bool fetches = !busy && !over;
        const uint taken = take_next(fetches, fetched);
        if (fetches) {
            busy = taken < end - first;
            over = !busy;
        }
        if (fetches && busy) {
            task.index = ordered ? order[first + taken] : first + taken;
            task.given = rays[task.index];
            begin(&task, &bounds, &stack);
        }
        works = vote(busy);

        bool decided = true;
        do {
            decided = visit_node(&tree, &task, &stack) && decided;
        } while (visits_nodes(&task));
        decided = decided && visit_leaves(&tree, &task, &stack);
        if (busy && !(decided && task.more)) {
            busy = task.more = false;
            task.postponed.count = 0;
            if (decided && !ANY_HIT) finish_hit(&task.given, task.ray.unscale, &task.hit);
            put_answer(task.index, task.hit, decided, hits, occluded, undecided_rays);
        }
    } while (works);
}
