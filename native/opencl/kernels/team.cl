// SPDX-License-Identifier: GPL-3.0-or-later
// What threads of a work-group tell each other. Kernels are written once against these operations,
// which have two forms: built with HAS_SUB_GROUPS (SubGroups of device.h) the threads of a
// sub-group meet and nobody else waits; without, all of the work-group meet at barriers and talk
// through local memory. Nothing is assumed about the size of a sub-group, nor of which work-items
// it is made; TEAM threads that belong together are in one sub-group, as the host has made sure.
//
// All threads that meet must call each of these together, unless it says otherwise.
//   TEAM  threads of a team, a divisor of the sub-group's and the group's size; 1 where not defined

#ifdef HAS_SUB_GROUPS
#ifdef cl_khr_subgroups
#pragma OPENCL EXTENSION cl_khr_subgroups : enable
#endif
#ifdef cl_khr_subgroup_shuffle
#pragma OPENCL EXTENSION cl_khr_subgroup_shuffle : enable
#endif
#ifdef cl_khr_subgroup_ballot
#pragma OPENCL EXTENSION cl_khr_subgroup_ballot : enable
#endif
#endif

#ifndef TEAM
#define TEAM 1
#endif

// --- who meets ----------------------------------------------------------------------------------

#ifdef HAS_SUB_GROUPS

/// Number of a thread in its work-group: those of a sub-group follow each other.
static uint thread_of_group(void) {
    return get_sub_group_id() * get_max_sub_group_size() + get_sub_group_local_id();
}

/// What threads wrote to local and global memory before, those that meet can read after.
#define MEET() sub_group_barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)

/// PoCL 6.0 hands results over in memory that the next call in a loop may write to before all have
/// read it.
#ifdef IS_GPU
#define SETTLE()
#else
#define SETTLE() sub_group_barrier(CLK_LOCAL_MEM_FENCE)
#endif

/// Whether any of the threads that meet says so; without sub-groups each decides for itself.
static bool vote(bool mine) {
    const bool any = sub_group_any(mine) != 0;
    SETTLE();
    return any;
}

/// Whether to take part in a step in which threads talk: by sub-groups all must where one needs it.
/// (PoCL 6.0 crashes where such a step may be left out.) Without, those that need it.
static bool takes_part(bool mine) {
#ifdef IS_GPU
    return vote(mine);
#else
    return true;
#endif
}

#else

static uint thread_of_group(void) {
    return (uint)get_local_id(0);
}

#define MEET() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)

static bool vote(bool mine) {
    return mine;
}

static bool takes_part(bool mine) {
    return mine;
}

#endif

#ifdef HAS_SHUFFLES
/// The word of a thread of the sub-group.
static uint shuffled(uint word, uint from) {
    const uint found = sub_group_shuffle(word, from);
    SETTLE();
    return found;
}
#endif

// --- work ---------------------------------------------------------------------------------------

#ifdef HAS_SUB_GROUPS

/// How many threads of a sub-group want something, before one of them and in all.
typedef struct {
    uint before, all;
} Wants;

#ifdef HAS_BALLOTS

/// The host has made sure that a sub-group has no more threads than a ballot has bits.
static Wants count_wants(bool mine) {
    const uint4 votes = sub_group_ballot(mine);
    SETTLE();
    const int lane = (int)get_sub_group_local_id();
    const int4 bits = clamp(lane - (int4)(0, 32, 64, 96), 0, 32);  // of each word, before the lane
    const uint4 below = convert_uint4((convert_ulong4((uint4)1) << convert_ulong4(bits)) - 1UL);
    const uint4 before = popcount(votes & below), all = popcount(votes);
    return (Wants){before.x + before.y + before.z + before.w, all.x + all.y + all.z + all.w};
}

#else

static Wants count_wants(bool mine) {
    Wants wants;
    wants.before = sub_group_scan_exclusive_add((uint)mine);
    SETTLE();
    wants.all = sub_group_reduce_add((uint)mine);
    SETTLE();
    return wants;
}

#endif
#endif

/// The next numbers from a counter, one for each thread that wants one; others get anything. By
/// sub-groups with one atomic for all of them (Aila and Laine 2009); without, a thread may be
/// alone.
static uint take_next(bool wants, volatile global uint* counter) {
#ifdef HAS_SUB_GROUPS
    const Wants counts = count_wants(wants);
    uint begin = 0;
    if (get_sub_group_local_id() == 0 && counts.all != 0) begin = atomic_add(counter, counts.all);
    begin = sub_group_broadcast(begin, 0);
    SETTLE();
    return begin + counts.before;
#else
    return wants ? atomic_inc(counter) : 0;
#endif
}

// --- words of a team ----------------------------------------------------------------------------
// Each thread puts its word, all MEET(), then each reads those of its team. `shared` has a word for
// each thread of the group. By sub-groups with shuffles it is not used; without, threads must have
// met for something else before the same memory is used anew.

/// For each thread by itself.
static void put_word(uint word, local uint* shared) {
#ifndef HAS_SHUFFLES
    shared[thread_of_group()] = word;
#endif
}

/// What thread `lane` of the team put, which was `word` in this one.
static uint word_of(uint lane, uint word, local const uint* shared) {
#ifdef HAS_SHUFFLES
    const uint own = get_sub_group_local_id();
    return shuffled(word, own - own % TEAM + lane);
#else
    const uint own = thread_of_group();
    return shared[own - own % TEAM + lane];
#endif
}

/// Whether the first thread of any team that meets put another word than `none`; `first` is what
/// that of the own team did.
static bool any_put_but(uint none, uint first, local const uint* shared) {
#ifdef HAS_SUB_GROUPS
    return vote(first != none);
#else
    for (uint thread = 0; thread < (uint)get_local_size(0); thread += TEAM)
        if (shared[thread] != none) return true;
    return false;
#endif
}
