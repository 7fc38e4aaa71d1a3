// SPDX-License-Identifier: GPL-3.0-or-later
// Makes reinsertions of which none hinders another (Meister and Bittner 2018b, section 3.2), as
// build/reinsertion_moves.cpp: every proposal asks for the slots it needs, the highest key wins a
// slot, and a proposal that wins all of its slots is made.
//
// Each kernel only reads what launches before it wrote, but for the maxima, whose order does not
// show.

#define OUT 0
#define ASKS 1
#define WON 2

// --- keys ---------------------------------------------------------------------------------------
// Gain as bits, above, and slot, below: no two are equal and none is 0. Positive floats order as
// their bits do, and negative ones are above them, the more negative the higher. Where a device has
// no atomics of 64 bits (SPLIT_KEYS), the maximum is found in two launches: that of the gains, then
// that of the slots among those who have it.

#define TAKEN 0xFFFFFFFFFFFFFFFFUL  // above every key

#define ASK_WHOLE 0U  // the only pass
#define ASK_GAIN 1U   // the first of two
#define ASK_SLOT 2U   // the second

#ifdef SPLIT_KEYS
#ifdef __ENDIAN_LITTLE__
#define LOW_HALF 0
#define HIGH_HALF 1
#else
#define LOW_HALF 1
#define HIGH_HALF 0
#endif

static void raise_key(global ulong* key, ulong own, uint pass) {
    volatile global uint* halves = (volatile global uint*)key;
    const uint gain = (uint)(own >> 32), slot = (uint)own;
    if (pass == ASK_GAIN)
        atomic_max(&halves[HIGH_HALF], gain);
    else if (halves[HIGH_HALF] == gain)
        atomic_max(&halves[LOW_HALF], slot);
}
#else
#pragma OPENCL EXTENSION cl_khr_int64_base_atomics : enable
#pragma OPENCL EXTENSION cl_khr_int64_extended_atomics : enable
static void raise_key(global ulong* key, ulong own, uint pass) {
    atom_max((volatile global ulong*)key, own);
}
#endif

static ulong own_key(Reinsertion move, uint slot) {
    return (ulong)as_uint(move.gain) << 32 | slot;
}

// --- slots that a reinsertion locks -------------------------------------------------------------

// Locks of the host
#define MINIMAL 0U       // the four slots that change: node, sibling, parent, target
#define AGGRESSIVE 1U    // and the parents of parent and target
#define CONSERVATIVE 2U  // `MINIMAL` and all nodes between node and target

// What is done with each of them
#define TAKE 0      // for good, by a move that has won
#define SEE_FREE 1  // is it not taken?
#define ASK 2
#define SEE_OWN 3  // is the own key the highest?

static bool use(int action, global ulong* keys, uint slot, ulong own, uint pass) {
    if (action == TAKE) keys[slot] = TAKEN;
    if (action == SEE_FREE) return keys[slot] != TAKEN;
    if (action == ASK) raise_key(&keys[slot], own, pass);
    if (action == SEE_OWN) return keys[slot] == own;
    return true;
}

/// Does it with every slot that the reinsertion locks, some more than once, until one says no.
/// Returns whether none did.
static bool use_all(int action, global const uint* parents, uint slot, Reinsertion move, uint locks,
                    global ulong* keys, uint pass) {
    const ulong own = own_key(move, slot);
    const uint parent = parents[slot >> 1], target = move.target;
    if (!use(action, keys, slot, own, pass) || !use(action, keys, slot ^ 1, own, pass) ||
        !use(action, keys, parent, own, pass) || !use(action, keys, target, own, pass))
        return false;
    if (locks == MINIMAL) return true;
    if (locks == AGGRESSIVE)
        return use(action, keys, parents[parent >> 1], own, pass) &&
               use(action, keys, parents[target >> 1], own, pass);

    // Up to the pivot, and from its sibling down to the target, or the other way round.
    for (uint node = slot; node != move.pivot;) {
        node = parents[node >> 1];
        if (!use(action, keys, node, own, pass)) return false;
    }
    if (target == move.pivot) return true;
    for (uint node = target; node != (move.pivot ^ 1);) {
        node = parents[node >> 1];
        if (!use(action, keys, node, own, pass)) return false;
    }
    return true;
}

// --- a round of locking -------------------------------------------------------------------------

/// All who propose something ask.
kernel void open_moves(global const Reinsertion* proposals,  // by slot
                       uint count,                           // slots
                       global uchar* states)                 // by slot: OUT or ASKS
{
    const uint slot = get_global_id(0);
    if (slot < count) states[slot] = proposals[slot].target == NO_TARGET ? OUT : ASKS;
}

/// Winners of earlier rounds take their slots again, once all keys are 0.
kernel void take_locks(global const uint* parents,           // by pair
                       global const Reinsertion* proposals,  // by slot
                       uint count,                           // slots
                       uint locks,                           // MINIMAL, AGGRESSIVE or CONSERVATIVE
                       global const uchar* states,           // by slot
                       global ulong* keys)                   // by slot: TAKEN or left
{
    const uint slot = get_global_id(0);
    if (slot < count && states[slot] == WON)
        use_all(TAKE, parents, slot, proposals[slot], locks, keys, ASK_WHOLE);
}

/// Those who need a slot that is taken are out.
kernel void drop_losers(global const uint* parents,           // by pair
                        global const Reinsertion* proposals,  // by slot
                        uint count,                           // slots
                        uint locks,                           // as above
                        global ulong* keys,                   // by slot
                        global uchar* states)                 // by slot: OUT or left
{
    const uint slot = get_global_id(0);
    if (slot < count && states[slot] == ASKS &&
        !use_all(SEE_FREE, parents, slot, proposals[slot], locks, keys, ASK_WHOLE))
        states[slot] = OUT;
}

/// Those who ask raise the keys of the slots they need.
kernel void ask_locks(global const uint* parents,           // by pair
                      global const Reinsertion* proposals,  // by slot
                      uint count,                           // slots
                      uint locks,                           // as above
                      uint pass,                            // ASK_WHOLE, or ASK_GAIN, then ASK_SLOT
                      global const uchar* states,           // by slot
                      global ulong* keys)                   // by slot
{
    const uint slot = get_global_id(0);
    if (slot < count && states[slot] == ASKS)
        use_all(ASK, parents, slot, proposals[slot], locks, keys, pass);
}

/// Those whose key is the highest everywhere have won.
kernel void decide(global const uint* parents,           // by pair
                   global const Reinsertion* proposals,  // by slot
                   uint count,                           // slots
                   uint locks,                           // as above
                   global ulong* keys,                   // by slot
                   global uchar* states,                 // by slot: WON or left
                   volatile global uint* won,            // how many, added to
                   volatile local uint* won_here)        // 1 word
{
    if (get_local_id(0) == 0) *won_here = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint slot = get_global_id(0);
    if (slot < count && states[slot] == ASKS &&
        use_all(SEE_OWN, parents, slot, proposals[slot], locks, keys, ASK_WHOLE)) {
        states[slot] = WON;
        atomic_inc(won_here);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0 && *won_here > 0) atomic_add(won, *won_here);
}

// --- moves --------------------------------------------------------------------------------------

/// Copies one side's lanes to one side of another vector.
static void copy_lanes(global const float4* from, uint from_side, global float4* to, uint to_side) {
    global const float* lanes = (global const float*)from;
    set_lanes(to, to_side, lanes[from_side], lanes[from_side + 2]);
}

/// Puts the node of one slot into another. Touches only these two sides of their pairs.
static void move_node(global SlotPair* pairs, global uint* parents, uint from, uint to) {
    global const SlotPair* source = &pairs[from >> 1];
    global SlotPair* target = &pairs[to >> 1];
    const uint from_side = from & 1, to_side = to & 1;
    copy_lanes(&source->boxes.lower_xy, from_side, &target->boxes.lower_xy, to_side);
    copy_lanes(&source->boxes.negated_upper_xy, from_side, &target->boxes.negated_upper_xy,
               to_side);
    copy_lanes(&source->boxes.z, from_side, &target->boxes.z, to_side);
    set_half_area(target, to_side, ((global const float*)&source->half_area)[from_side]);
    set_child(pairs, parents, to, ((global const uint*)&source->child)[from_side]);
}

/// Makes the moves that have won. The node stays in its slot. Its sibling takes the parent's slot,
/// the target takes the sibling's, and the target's old slot becomes their parent. Right also where
/// the target is an ancestor or below the sibling. Boxes above are not refitted.
///
/// A move reads and writes its four locked slots and the parents of the pairs below them; nobody
/// else has these.
kernel void reinsert(global const Reinsertion* proposals,  // by slot
                     global const uchar* states,           // by slot
                     uint count,                           // slots
                     global SlotPair* pairs,               // the tree
                     global uint* parents)                 // by pair
{
    const uint slot = get_global_id(0);
    if (slot >= count || states[slot] != WON) return;
    const uint target = proposals[slot].target, sibling = slot ^ 1;
    move_node(pairs, parents, sibling, parents[slot >> 1]);
    move_node(pairs, parents, target, sibling);
    set_child(pairs, parents, target, slot >> 1);
}
