// SPDX-License-Identifier: GPL-3.0-or-later
// Hill climbing: the best reinsertion (BestReinsertion in build/reinsertion_search.h), and which
// nodes search for one.

// --- choice -------------------------------------------------------------------------------------

typedef struct {
    Reinsertion best;
    float area;  // half, of the removed node
} Choice;

#define CHOICE_PARAMETERS
#define CHOICE_ARGUMENTS 0

/// Both nodes of a pair search.
static bool start(Choice* choice, uint slot, int unused) {
    choice->best = (Reinsertion){0.0F, NO_TARGET, NO_TARGET};
    return true;
}

static void begin(Choice* choice, float area) {
    choice->area = area;
}

static void offer(Choice* choice, float gain, uint target, uint pivot) {
    if (gain > choice->best.gain) choice->best = (Reinsertion){gain, target, pivot};
}

static bool ends(const Choice* choice, float gain) {
    return gain - choice->area <= choice->best.gain;
}

/// The second condition makes locking few slots safe, see Locks in build/reinsertion_moves.h.
static bool hopes(const Choice* choice, float gain, float area) {
    return !ends(choice, gain) && area > choice->area;
}

static Reinsertion proposal(const Choice* choice) {
    return choice->best;
}

// --- which pairs search -------------------------------------------------------------------------

/// Clears all proposals and lists the pairs that search.
kernel void choose_pairs(uint count,                     // pairs
                         uint all,                       // 0: those marked in `marks`
                         uint sparsity, uint remainder,  // else those that leave `remainder`
                         global const uchar* marks,      // by pair
                         global Reinsertion* proposals,  // by slot
                         global uint* searchers,         // gets the pairs
                         volatile global uint* searcher_count,
                         volatile local uint* shared)  // 2 words
{
    const uint pair = get_global_id(0);
    bool searches = false;
    if (pair < count) {
        const Reinsertion none = {0.0F, NO_TARGET, NO_TARGET};
        proposals[2 * pair] = none;
        proposals[2 * pair + 1] = none;
        if (pair > 0) searches = all ? pair % sparsity == remainder : marks[pair] != 0;
    }
    append(searches, pair, searchers, searcher_count, shared);
}

// --- surroundings of moves ----------------------------------------------------------------------

#define GENERATIONS_NEAR 4  // levels above a node that count as near

static void mark_around(global const SlotPair* pairs, global const uint* parents,
                        global uchar* marks, uint slot) {
    const uint child = child_of(pairs, slot);
    if (!is_leaf(child)) marks[child] = 1;
    for (int generation = 0; generation < GENERATIONS_NEAR; ++generation) {
        if (slot < 2) return;
        marks[slot >> 1] = 1;
        slot = parents[slot >> 1];
    }
}

/// Marks the pairs whose boxes or neighbours the proposals would change: those of the nodes below
/// and of some generations above node, sibling and target. All write the same value.
kernel void mark_surroundings(global const SlotPair* pairs,         // the tree before the moves
                              global const uint* parents,           // by pair
                              global const Reinsertion* proposals,  // by slot
                              uint count,                           // slots
                              global uchar* marks)                  // by pair, all 0 before
{
    const uint slot = get_global_id(0);
    if (slot >= count) return;
    const uint target = proposals[slot].target;
    if (target == NO_TARGET) return;
    mark_around(pairs, parents, marks, slot);
    mark_around(pairs, parents, marks, slot ^ 1);
    mark_around(pairs, parents, marks, target);
}
