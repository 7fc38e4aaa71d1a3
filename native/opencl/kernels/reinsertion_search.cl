// SPDX-License-Identifier: GPL-3.0-or-later
// Searches for new positions of nodes (Meister and Bittner 2018b, section 3.1), one work-item for
// two siblings, as build/reinsertion_search.h: the same positions in the same order with the same
// arithmetic. The file before this one defines Choice.
//
// Nodes that wait to be visited are on a stack of few entries, since most trees need no more. A
// search that needs more gives up and is done anew by the program with DEEP, which has
// stacks of MOST_VISITS entries in global memory, for a few searches at a time.

#define MOST_VISITS 4096U  // ReinsertionSearch::most_visits: pairs visited for two siblings
#define STACK_ENTRIES 48U

/// Gain as bits, then pair.
typedef uint2 Subtree;

#ifdef DEEP
typedef struct {
    global Subtree* entries;
    size_t stride;  // from one entry of a work-item to its next
} Stack;
#define STACK_ENTRY(stack, i) (stack)->entries[(i) * (stack)->stride]
#define SEARCH search_deep
#else
typedef struct {
    Subtree entries[STACK_ENTRIES];
} Stack;
#define STACK_ENTRY(stack, i) (stack)->entries[i]
#define SEARCH search
#endif

// --- downwards ----------------------------------------------------------------------------------

/// Visits the nodes below a node, the more promising child first. Returns false where the stack is
/// too small; the choice is of no use then.
static bool descend(global const SlotPair* pairs,  // the tree
                    uint pair, float gain,         // children of the node, and what is saved there
                    BoxPair removed,               // the removed node's box on both sides
                    uint pivot,                    // as in Reinsertion
                    Choice* choice, Stack* stack,
                    uint* visits)  // of this search so far
{
    uint waiting = 0;
    for (;;) {
        ++*visits;
        const SlotPair next = pairs[pair];
        const float2 areas = half_areas(unite_pairs(next.boxes, removed));
        const float2 gains = gain + (next.half_area - areas);
        offer(choice, gain - areas.x, 2 * pair, pivot);
        offer(choice, gain - areas.y, 2 * pair + 1, pivot);

        const bool swapped = gains.y > gains.x;
        const uint first = swapped ? next.child.y : next.child.x;
        const uint second = swapped ? next.child.x : next.child.y;
        const float first_gain = swapped ? gains.y : gains.x;
        const float second_gain = swapped ? gains.x : gains.y;
        const float first_area = swapped ? next.half_area.y : next.half_area.x;
        const float second_area = swapped ? next.half_area.x : next.half_area.y;
        if (!is_leaf(second) && hopes(choice, second_gain, second_area)) {
#ifndef DEEP
            if (waiting == STACK_ENTRIES) return false;
#endif
            STACK_ENTRY(stack, waiting++) = (Subtree)(as_uint(second_gain), second);
        }
        if (!is_leaf(first) && hopes(choice, first_gain, first_area) && *visits < MOST_VISITS) {
            pair = first;
            gain = first_gain;
            continue;
        }
        do {
            if (*visits >= MOST_VISITS || waiting == 0) return true;
            const Subtree popped = STACK_ENTRY(stack, --waiting);
            gain = as_float(popped.x);
            pair = popped.y;
        } while (ends(choice, gain));
    }
}

// --- upwards ------------------------------------------------------------------------------------

/// Enters the sibling at the pivot, or that of the nodes themselves. Returns false as descend().
static bool enter(global const SlotPair* pairs, uint child, float area, float gain, BoxPair removed,
                  uint pivot, Choice* choice, Stack* stack, uint* visits) {
    if (is_leaf(child) || !hopes(choice, gain, area)) return true;
    return descend(pairs, child, gain, removed, pivot, choice, stack, visits);
}

/// Takes the pivot, whose box without the node has `rest_area`, as a target, and adds what it
/// shrinks by to the gain.
static void shrink(uint pivot, float area, float rest_area, float* gain, Choice* choice) {
    // The new parent gets the pivot's old box, the pivot the smaller one.
    if (pivot != ROOT) offer(choice, *gain - rest_area, pivot, pivot);
    *gain += area - rest_area;
}

/// For those nodes of a pair that are `active`; sides are bits. Returns false as descend().
static bool search_pair(global const SlotPair* pairs, global const uint* parents, uint pair,
                        uint active, Choice* choices, Stack* stack) {
    uint visits = 0;
    const SlotPair family = pairs[pair];
    const BoxPair boxes = family.boxes;
    for (uint side = 0; side < 2; ++side) {
        if ((active >> side & 1) == 0) continue;
        Choice choice = choices[side];
        begin(&choice, side == 0 ? family.half_area.x : family.half_area.y);
        // Entering the sibling makes it as large as the parent, whose area is saved.
        const float area = side == 0 ? family.half_area.y : family.half_area.x;
        if (!enter(pairs, of_side(family.child, 1 - side), area, area, repeat_side(boxes, side),
                   2 * pair + side, &choice, stack, &visits))
            return false;
        choices[side] = choice;
    }

    uint pivot = parents[pair];
    BoxPair rest = swap_sides(boxes);  // the pivot's box without the one node and the other
    float gains[2];                    // area saved so far
    gains[0] = gains[1] = half_area_of(pairs, pivot);
    uint shrinking = active;  // those without which boxes above would shrink
    while (pivot != ROOT) {
        ++visits;
        const SlotPair level = pairs[pivot >> 1];
        const uint other = 1 - (pivot & 1);
        const BoxPair other_box = repeat_side(level.boxes, other);
        const float other_area = other == 0 ? level.half_area.x : level.half_area.y;
        const float2 united = half_areas(unite_pairs(boxes, other_box));
        for (uint side = 0; side < 2; ++side) {
            if ((active >> side & 1) == 0) continue;
            Choice choice = choices[side];
            const float gain = gains[side], area = side == 0 ? united.x : united.y;
            offer(&choice, gain - area, pivot ^ 1, pivot);
            if (!enter(pairs, of_side(level.child, other), other_area, gain + (other_area - area),
                       repeat_side(boxes, side), pivot, &choice, stack, &visits))
                return false;
            if ((shrinking >> side & 1) == 0 && ends(&choice, gain)) active &= ~(1U << side);
            choices[side] = choice;
        }
        if (active == 0 || visits >= MOST_VISITS) return true;
        pivot = parents[pivot >> 1];
        if (shrinking == 0) continue;

        rest = unite_pairs(rest, other_box);
        const SlotPair above = pairs[pivot >> 1];
        const float area = (pivot & 1) == 0 ? above.half_area.x : above.half_area.y;
        const float2 rest_areas = half_areas(rest);
        const int2 smaller = differ(rest, repeat_side(above.boxes, pivot & 1));
        if (shrinking & 1) shrink(pivot, area, rest_areas.x, &gains[0], &choices[0]);
        if (shrinking & 2) shrink(pivot, area, rest_areas.y, &gains[1], &choices[1]);
        shrinking &= (smaller.x ? 1U : 0U) | (smaller.y ? 2U : 0U);
    }
    return true;
}

// --- kernel -------------------------------------------------------------------------------------

/// Fills the proposals of `count` pairs that take part. All others hold none already.
kernel void SEARCH(global const SlotPair* pairs,       // the tree, which is not changed
                   global const uint* parents,         // by pair
                   global const uint* searchers,       // pairs to search for
                   uint first, uint count,             // which of them
                   CHOICE_PARAMETERS                   // of the program's choice
                       global Reinsertion* proposals,  // by slot
#ifdef DEEP
                   global Subtree* stacks)  // MOST_VISITS entries to a work-item
#else
                   global uint* deep,                 // gets pairs whose searches gave up
                   volatile global uint* deep_count)  // how many
#endif
{
    const uint id = get_global_id(0);
    if (id >= count) return;
    const uint pair = searchers[first + id];
    Stack stack;
#ifdef DEEP
    stack.entries = stacks + id;
    stack.stride = count;
#endif
    Choice choices[2];
    uint active = 0;
    for (uint side = 0; side < 2; ++side)
        if (start(&choices[side], 2 * pair + side, CHOICE_ARGUMENTS)) active |= 1U << side;
    if (!search_pair(pairs, parents, pair, active, choices, &stack)) {
#ifndef DEEP
        deep[atomic_inc(deep_count)] = pair;
#endif
        return;
    }
    proposals[2 * pair] = proposal(&choices[0]);
    proposals[2 * pair + 1] = proposal(&choices[1]);
}
