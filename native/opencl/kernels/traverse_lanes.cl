// SPDX-License-Identifier: GPL-3.0-or-later
// 4- and 8-wide trees on GPUs: WIDTH threads for each ray, one for each child of a node or triangle
// of a leaf (Lier, Stamminger, Selgrad 2018). Children that are entered are ranked by distance, so
// that each thread knows its own child's place on the stack. Threads talk by team.cl: where the
// device has sub-groups they wait for nobody beyond their own, else for the whole group.
// GROUP: threads of a group, a multiple of WIDTH, which is TEAM. LANES is 1. ANY_HIT: 0 or 1.

#define TEAMS (GROUP / WIDTH)

/// Urgency of a child that is not entered, and t of an undecided triangle: NaN, of which every
/// comparison is false.
#define NOT_ENTERED NAN
#define UNDECIDED NAN

/// A ray's entries: the lowest in local memory, those of deep trees in global memory. What is in
/// neither leaves the ray undecided.
typedef struct {
    __local StackEntry* near_entries;
    uint near_capacity;
    __global StackEntry* far_entries;
    uint capacity;  // of both
} TeamStack;

/// Where a team is; all of its threads have the same.
typedef struct {
    uint index;  // of the ray
    Hit hit;
    StackEntry current;  // node or leaf to go on with
    uint top;            // entries on the stack
} Walk;

/// Words that threads share.
typedef struct {
    uint position[GROUP];  // of the ray, or NO_RAY
    uint t[GROUP];         // of the closest hit, or a child's urgency
    uint u[GROUP], v[GROUP], triangle[GROUP];
} Shared;

#define NO_RAY 0xFFFFFFFFU

// --- one thread's share -------------------------------------------------------------------------

/// Whether the ray enters child `lane` of a node no farther than `t_far`; and how urgent it is.
inline float urgency_of(__global const Node* node, uint lane, const PreparedRay* ray, float t_far) {
    float enter = ray->t_min, leave = t_far;
    for (uint axis = 0; axis < 3; ++axis) {
        const Slab* slab = &ray->slab[axis];
        const float near_plane = node->planes[2 * axis + slab->negative][lane];
        const float far_plane = node->planes[2 * axis + 1 - slab->negative][lane];
        const float from = (near_plane - slab->near_origin) * slab->near_inverse;
        const float to = (far_plane - slab->far_origin) * slab->far_inverse;
        enter = enter < from ? from : enter;
        leave = to < leave ? to : leave;
    }
    if (!(enter <= leave)) return NOT_ENTERED;
    return ANY_HIT ? -leave : enter;
}

/// Lets triangles lane, lane + WIDTH, ... of a leaf compete for `hit`. False where one is
/// undecided.
inline bool intersect_share(const Tree* tree, const PreparedRay* ray, const Ray* given,
                            const StackEntry* leaf, uint lane, Hit* hit) {
    for (uint i = lane; i < leaf->count; i += WIDTH) {
        const Block block = block_of(tree, leaf, i);
        if (may_meet(ray, block.rows, block.stride) == 0) continue;
        Hit found;
        const Meeting meeting =
            meets_triangle(ray, given, block.rows, block.stride, hit->t, &found);
        if (meeting == undecided) return false;
        if (meeting == missed) continue;
        found.triangle = block.triangles[0];
        if (found.t < hit->t || (found.t == hit->t && found.triangle < hit->triangle)) *hit = found;
    }
    return true;
}

// --- stack --------------------------------------------------------------------------------------

inline void put_entry(const TeamStack* stack, uint place, StackEntry entry) {
    if (place < stack->near_capacity)
        stack->near_entries[place] = entry;
    else
        stack->far_entries[place - stack->near_capacity] = entry;
}

inline StackEntry entry_at(const TeamStack* stack, uint place) {
    return place < stack->near_capacity ? stack->near_entries[place]
                                        : stack->far_entries[place - stack->near_capacity];
}

/// Makes the next entry that may matter current; false where there is none.
inline bool next_entry(const TeamStack* stack, Walk* walk) {
    while (walk->top != 0) {
        walk->current = entry_at(stack, --walk->top);
        if (ANY_HIT || !(walk->current.urgency > walk->hit.t)) return true;
    }
    return false;
}

// --- a team's steps -----------------------------------------------------------------------------

/// The children that are entered, as one thread sees them.
typedef struct {
    uint entered;   // how many
    uint rank;      // of its own among them, the most urgent first
    uint nearest;   // which
    float urgency;  // of the nearest
} Ranking;

inline Ranking ranking_of(float own, uint lane, __local const Shared* shared) {
    Ranking ranking = {0, 0, 0, NOT_ENTERED};
    for (uint i = 0; i < WIDTH; ++i) {
        const float urgency = as_float(word_of(i, as_uint(own), shared->t));
        const bool entered = urgency == urgency, nearer = !(ranking.urgency <= urgency);
        ranking.entered += entered;
        ranking.rank += urgency < own || (urgency == own && i < lane);
        ranking.nearest = entered && nearer ? i : ranking.nearest;
        ranking.urgency = entered && nearer ? urgency : ranking.urgency;
    }
    return ranking;
}

/// Goes on with the most urgent child; each thread puts its own where its rank says, the least
/// urgent first. False where the stack has no room.
inline bool enter_children(const Tree* tree, const TeamStack* stack, const Ranking* ranking,
                           float own, uint lane, Walk* walk) {
    const uint node = walk->current.child, end = walk->top + ranking->entered - 1;
    if (end > stack->capacity) return false;
    if (own == own && ranking->rank != 0)
        put_entry(stack, end - ranking->rank, child_of(tree, node, lane, own));
    walk->current = child_of(tree, node, ranking->nearest, ranking->urgency);
    walk->top = end;
    return true;
}

/// The nearest of the hits that the team's threads found. False where one is undecided.
inline bool take_nearest(Hit own, __local const Shared* shared, Hit* nearest) {
    bool decided = true;
    uint from = 0;
    for (uint i = 0; i < WIDTH; ++i) {
        const float t = as_float(word_of(i, as_uint(own.t), shared->t));
        const uint triangle = word_of(i, own.triangle, shared->triangle);
        decided = decided && t == t;
        if (i != 0 && !(t < nearest->t || (t == nearest->t && triangle < nearest->triangle)))
            continue;
        nearest->t = t;
        nearest->triangle = triangle;
        from = i;
    }
    nearest->u = as_float(word_of(from, as_uint(own.u), shared->u));
    nearest->v = as_float(word_of(from, as_uint(own.v), shared->v));
    return decided;
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void traverse_lanes(
    TRACE_ARGUMENTS,
    __global uint* fetched,           // rays taken, 0 at first
    __local StackEntry* near_stacks,  // near_capacity for each team
    uint near_capacity,
    __global StackEntry* far_stacks,  // far_capacity for each team
    uint far_capacity) {
    __local Shared shared;
    const uint thread = thread_of_group();
    const uint lane = thread % WIDTH, team = thread / WIDTH;
    const Tree tree = {nodes, leaves, triangles};
    const TeamStack stack = {near_stacks + team * near_capacity, near_capacity,
                             far_stacks + ((size_t)get_group_id(0) * TEAMS + team) * far_capacity,
                             near_capacity + far_capacity};
    Ray given;
    PreparedRay ray;
    Walk walk;
    uint position = 0;
    bool idle = true, left;
    do {
        // Teams without a ray take the next.
        const bool fetches = idle && lane == 0 && position != NO_RAY;
        const uint taken = take_next(fetches, fetched);
        if (fetches) position = taken < end - first ? first + taken : NO_RAY;
        put_word(position, shared.position);
        MEET();
        position = word_of(0, position, shared.position);
        left = any_put_but(NO_RAY, position, shared.position);
        if (idle && position != NO_RAY) {
            walk.index = ordered ? order[position] : position;
            given = rays[walk.index];
            ray = prepared(&given, &bounds);
            walk.hit = (Hit){ray.t_max, 0.0F, 0.0F, NO_TRIANGLE};
            walk.current = (StackEntry){ray.t_min, 0, 0};
            walk.top = 0;
            idle = false;
        }

        // Each thread tests its child or its triangles.
        const bool tests = !idle && given.t_min <= given.t_max;
        const bool at_node = tests && walk.current.count == 0, at_leaf = tests && !at_node;
        Hit own = {NOT_ENTERED, 0.0F, 0.0F, NO_TRIANGLE};
        if (at_node) own.t = urgency_of(&nodes[walk.current.child], lane, &ray, walk.hit.t);
        if (at_leaf) {
            own = walk.hit;
            if (!intersect_share(&tree, &ray, &given, &walk.current, lane, &own)) own.t = UNDECIDED;
        }
        put_word(as_uint(own.t), shared.t);
        if (at_leaf) {
            put_word(as_uint(own.u), shared.u);
            put_word(as_uint(own.v), shared.v);
            put_word(own.triangle, shared.triangle);
        }
        MEET();

        // What they found becomes the team's.
        bool decided = true, more = tests;
        if (takes_part(at_node)) {
            const Ranking ranking = ranking_of(own.t, lane, &shared);
            if (at_node) {
                if (ranking.entered == 0)
                    more = next_entry(&stack, &walk);
                else
                    decided = enter_children(&tree, &stack, &ranking, own.t, lane, &walk);
            }
        }
        if (takes_part(at_leaf)) {
            Hit nearest;
            const bool all_decided = take_nearest(own, &shared, &nearest);
            if (at_leaf) {
                walk.hit = nearest;
                decided = all_decided;
                more = !(ANY_HIT && nearest.triangle != NO_TRIANGLE) && next_entry(&stack, &walk);
            }
        }
        if (!idle && !(decided && more)) {
            idle = true;
            if (lane == 0) {
                if (decided && !ANY_HIT) finish_hit(&given, ray.unscale, &walk.hit);
                put_answer(walk.index, walk.hit, decided, hits, occluded, undecided_rays);
            }
        }
    } while (left);
}
