// SPDX-License-Identifier: GPL-3.0-or-later
// 4- and 8-wide trees on GPUs: WIDTH threads for each ray, one for each child of a node or triangle
// of a leaf (Lier, Stamminger, Selgrad 2018). Children that are entered are ranked by distance, so
// that each thread knows its own child's place on the stack. Threads meet at barriers of the whole
// group, whatever the device's own width is. GROUP: threads of a group, a multiple of WIDTH.
// LANES is 1. ANY_HIT: 0 or 1. TEAM_STACK: entries of a ray's stack in local memory; a ray that
// needs more is left undecided.

#define TEAMS (GROUP / WIDTH)

/// Urgency of a child that is not entered: NaN, of which every comparison is false.
#define NOT_ENTERED NAN

/// What a ray's threads share.
typedef struct {
    StackEntry stack[TEAM_STACK];
    uint top;
    StackEntry current;  // node or leaf to go on with
    uint index;          // of the ray
    uint state;          // one of those below
    uint undecided;      // not 0: a triangle could not be decided
} Team;

enum { state_idle, state_fresh, state_tracing, state_over };

/// What one thread found.
typedef struct {
    float urgency[GROUP];  // of its child, or NOT_ENTERED
    Hit hit[GROUP];        // of its triangles
} Findings;

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

// --- a team's steps -----------------------------------------------------------------------------

/// Puts the thread's child where its rank among those entered says: the most urgent is next, the
/// others go on the stack, the least urgent first. Returns how many are entered.
inline uint place_child(const Tree* tree, __local Team* team, uint node, uint top, uint lane,
                        __local const float* urgency) {
    const float own = urgency[lane];
    uint entered = 0, rank = 0;
    for (uint i = 0; i < WIDTH; ++i) {
        entered += urgency[i] == urgency[i];
        rank += urgency[i] < own || (urgency[i] == own && i < lane);
    }
    if (own == own && top + entered <= TEAM_STACK) {
        const StackEntry entry = child_of(tree, node, lane, own);
        if (rank == 0)
            team->current = entry;
        else
            team->stack[top + entered - 1 - rank] = entry;
    }
    return entered;
}

/// The nearest of the hits that the team's threads found.
inline void take_nearest(__local const Hit* found, Hit* hit) {
    for (uint i = 0; i < WIDTH; ++i) {
        const Hit other = found[i];
        if (other.t < hit->t || (other.t == hit->t && other.triangle < hit->triangle)) *hit = other;
    }
}

/// Makes the next entry that may matter current; false where there is none.
inline bool next_entry(__local Team* team, const Hit* hit) {
    while (team->top != 0) {
        team->current = team->stack[--team->top];
        if (ANY_HIT || !(team->current.urgency > hit->t)) return true;
    }
    return false;
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void traverse_lanes(
    __global const Node* nodes, __global const float* leaves, __global const uint* triangles,
    Box bounds,  // of the mesh
    __global const Ray* rays,
    __global const uint* order,  // rays in the order in which to trace them
    uint ordered,                // 0: as they come, without `order`
    uint first,                  // rays before these were traced
    uint end,
    __global Hit* hits,             // by ray; not for any hit
    __global uchar* occluded,       // by ray; any hit only
    __global uint* undecided_rays,  // their number, then the rays
    __global uint* fetched) {       // rays taken, 0 at first
    __local Team teams[TEAMS];
    __local Findings findings;
    __local uint working;  // teams that are not over
    const uint thread = (uint)get_local_id(0);
    const uint lane = thread % WIDTH;
    const uint team_first = thread - lane;
    __local Team* const team = &teams[thread / WIDTH];
    const Tree tree = {nodes, leaves, triangles};
    Ray given = {{0.0F, 0.0F, 0.0F}, 0.0F, {0.0F, 0.0F, 0.0F}, 0.0F};
    PreparedRay ray;
    Hit hit;  // the team's, in each of its threads
    if (thread == 0) working = TEAMS;
    if (lane == 0) team->state = state_idle;
    uint left;
    barrier(CLK_LOCAL_MEM_FENCE);
    do {
        // The first thread of a team without a ray takes the next.
        if (lane == 0 && team->state == state_idle) {
            const uint taken = atomic_inc(fetched);
            if (taken < end - first) {
                team->index = ordered ? order[first + taken] : first + taken;
                team->state = state_fresh;
                team->top = 0;
                team->undecided = 0;
                team->current = (StackEntry){0.0F, 0, 0};
            } else {
                team->state = state_over;
                atomic_dec(&working);
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        left = working;  // nobody writes to it until all have passed the end of this step

        // Each thread tests its child or its triangles.
        const uint state = team->state, top = team->top;
        const StackEntry current = team->current;
        if (state == state_fresh) {
            given = rays[team->index];
            ray = prepared(&given, &bounds);
            hit = (Hit){ray.t_max, 0.0F, 0.0F, NO_TRIANGLE};
        }
        const bool tests = state != state_over && given.t_min <= given.t_max;
        if (tests) {
            if (current.count == 0) {
                findings.urgency[thread] = urgency_of(&nodes[current.child], lane, &ray, hit.t);
            } else {
                Hit own = hit;
                if (!intersect_share(&tree, &ray, &given, &current, lane, &own))
                    team->undecided = 1;
                findings.hit[thread] = own;
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);

        // What they found becomes the team's; the first thread looks after stack and result.
        if (state != state_over) {
            bool more = false, decided = true;
            if (tests && current.count == 0) {
                const uint entered = place_child(&tree, team, current.child, top, lane,
                                                 &findings.urgency[team_first]);
                decided = top + entered <= TEAM_STACK;
                if (lane == 0) {
                    if (entered != 0) team->top = top + entered - 1;
                    more = entered != 0 || next_entry(team, &hit);
                }
            } else if (tests) {
                take_nearest(&findings.hit[team_first], &hit);
                decided = team->undecided == 0;
                const bool ends = ANY_HIT && hit.triangle != NO_TRIANGLE;
                if (lane == 0) more = !ends && next_entry(team, &hit);
            }
            if (lane == 0) {
                team->state = state_tracing;
                if (!decided || !more) {
                    team->state = state_idle;
                    if (!decided) {
                        undecided_rays[1 + atomic_inc(undecided_rays)] = team->index;
                    } else if (ANY_HIT) {
                        occluded[team->index] = hit.triangle != NO_TRIANGLE;
                    } else {
                        finish_hit(&given, ray.unscale, &hit);
                        hits[team->index] = hit;
                    }
                }
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    } while (left != 0);
}
