// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers the nodes of a binary tree in depth-first order, as bvh/depth_first.cpp; for trees of any
// depth in a number of launches that grows with its logarithm.

#define ROOT 0

/// From an interior node to one above it: how much larger than the upper node's are its number in
/// the new order and the number of its first leaf.
typedef struct {
    uint upper;
    uint nodes;
    uint leaves;
} Jump;

// --- leaves below each node ---------------------------------------------------------------------

kernel void link_parents(global const uint2* children,  // by interior node
                         uint count,                    // of interior nodes
                         global uint* parents)          // by node; of the root none is written
{
    const uint node = (uint)get_global_id(0);
    if (node >= count) return;
    const uint2 pair = children[node];
    parents[pair.x] = node;
    parents[pair.y] = node;
}

/// Each leaf walks up; at a node the first of two ends, and the second goes on with the sum. What
/// the other subtree holds comes with the atomic addition itself, so this needs no order of memory
/// between work-groups.
kernel void count_leaves(global const uint* parents,    // by node
                         uint count,                    // of interior nodes
                         volatile global uint* leaves)  // by interior node; 0 at first
{
    const uint leaf = (uint)get_global_id(0);
    if (leaf > count) return;
    uint node = count + leaf, below = 1;
    do {
        node = parents[node];
        const uint others = atomic_add(&leaves[node], below);
        if (others == 0) return;
        below += others;
    } while (node != ROOT);
}

static uint leaves_of(uint node, uint count, global const uint* leaves) {
    return node >= count ? 1 : leaves[node];
}

// --- places by doubling jumps (Wyllie 1979) -----------------------------------------------------

kernel void first_jumps(global const uint2* children,  // by interior node
                        uint count,                    // of interior nodes
                        global const uint* leaves,     // by interior node
                        global Jump* jumps)            // by interior node
{
    const uint node = (uint)get_global_id(0);
    if (node >= count) return;
    if (node == ROOT) jumps[ROOT] = (Jump){ROOT, 0, 0};
    const uint2 pair = children[node];
    const uint left_leaves = leaves_of(pair.x, count, leaves);
    if (pair.x < count) jumps[pair.x] = (Jump){node, 1, 0};
    if (pair.y < count) jumps[pair.y] = (Jump){node, left_leaves, left_leaves};
}

kernel void double_jumps(global const Jump* jumps,          // by interior node
                         uint count,                        // of interior nodes
                         global Jump* doubled,              // twice as far, or to the root
                         volatile global uint* unfinished,  // set to 1 where one does not reach it
                         volatile local uint* of_group)     // one: the same of a work-group
{
    const uint node = (uint)get_global_id(0);
    if (get_local_id(0) == 0) *of_group = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (node < count) {
        Jump jump = jumps[node];
        if (jump.upper != ROOT) {
            const Jump next = jumps[jump.upper];
            jump = (Jump){next.upper, jump.nodes + next.nodes, jump.leaves + next.leaves};
            if (next.upper != ROOT) atomic_or(of_group, 1);
        }
        doubled[node] = jump;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0 && *of_group) atomic_or(unfinished, 1);
}

// --- the new order ------------------------------------------------------------------------------

/// The number of a child, to which leaf and box are written if it is one.
static uint place_child(uint child, uint number, uint leaf, uint count, global const Box* boxes,
                        global const uint* references, global Box* new_boxes,
                        global uint* new_references) {
    if (child < count) return number;
    new_boxes[count + leaf] = boxes[child];
    new_references[leaf] = references[child - count];
    return count + leaf;
}

kernel void place_nodes(global const uint2* children,   // the old tree
                        global const Box* boxes,        // its boxes
                        global const uint* references,  // its references
                        uint count,                     // of interior nodes
                        global const uint* leaves,      // by old interior node
                        global const Jump* jumps,       // from it to the root
                        global uint2* new_children,     // the new tree
                        global Box* new_boxes,          // its boxes
                        global uint* new_references)    // its references
{
    const uint node = (uint)get_global_id(0);
    if (node >= count) return;
    const uint2 pair = children[node];
    const uint left_leaves = leaves_of(pair.x, count, leaves);
    const uint number = jumps[node].nodes, leaf = jumps[node].leaves;
    const uint left =
        place_child(pair.x, number + 1, leaf, count, boxes, references, new_boxes, new_references);
    const uint right = place_child(pair.y, number + left_leaves, leaf + left_leaves, count, boxes,
                                   references, new_boxes, new_references);
    new_children[number] = (uint2)(left, right);
    new_boxes[number] = boxes[node];
}
