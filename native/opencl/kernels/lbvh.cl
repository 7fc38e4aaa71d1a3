// SPDX-License-Identifier: GPL-3.0-or-later
// The binary radix tree over sorted Morton codes (Karras 2012), numbered depth-first as the CPU's.
// Needs range_boxes.cl before it.

/// An interior node of Karras' numbering: node i is over the places between i and `other`, either
/// of which may be the first; its left child ends at place `split`.
typedef struct {
    uint other;
    uint split;
} RadixNode;

// --- topology -----------------------------------------------------------------------------------

/// Length of the common prefix of two codes, as in build/lbvh.cpp; -1 beyond the ends.
static int common_prefix(global const ulong* codes, int count, int i, int j) {
    if (j < 0 || j >= count) return -1;
    const ulong difference = codes[i] ^ codes[j];
    return difference != 0 ? (int)clz(difference) : 64 + (int)clz((uint)(i ^ j));
}

kernel void radix_tree(global const ulong* codes,  // ascending
                       uint count,                 // of codes
                       global RadixNode* nodes)    // count - 1
{
    const int i = (int)get_global_id(0), size = (int)count;
    if (i >= size - 1) return;

    // The node goes on to where the prefix is longer (Karras 2012, section 4).
    const int after = common_prefix(codes, size, i, i + 1);
    const int before = common_prefix(codes, size, i, i - 1);
    const int step = after > before ? 1 : -1;
    const int shortest = min(after, before);
    int most = 2;
    while (common_prefix(codes, size, i, i + most * step) > shortest) most *= 2;
    int length = 0;
    for (int more = most / 2; more >= 1; more /= 2)
        if (common_prefix(codes, size, i, i + (length + more) * step) > shortest) length += more;
    const int other = i + length * step;

    // The last place that shares more with the first than the last does.
    const int prefix = common_prefix(codes, size, i, other);
    int low = min(i, other), high = max(i, other);
    const int first = low;
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        if (common_prefix(codes, size, first, middle) > prefix)
            low = middle;
        else
            high = middle;
    }
    nodes[i] = (RadixNode){(uint)other, (uint)low};
}

// --- depth-first numbers ------------------------------------------------------------------------
// In depth-first order nodes are sorted by their first place, and those that begin at one place are
// a chain of left children, the uppermost first. It is a right child or the root, and so (Karras)
// the node whose index is that place. So the number of a node is the length of all chains that
// begin at earlier places and its own rank in its chain.

kernel void chain_lengths(global const RadixNode* nodes,  // of the radix tree
                          uint count,                     // of nodes
                          global uint* lengths)           // by place: 0 where none begins
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    uint length = 0;
    if (nodes[i].other > i) {
        uint node = i;
        for (length = 1; nodes[node].split != i; ++length) node = nodes[node].split;
    }
    lengths[i] = length;
}

kernel void number_chains(global const RadixNode* nodes,  // of the radix tree
                          uint count,                     // of nodes
                          global const uint* starts,      // scanned lengths
                          global uint* numbers)           // by node
{
    const uint i = (uint)get_global_id(0);
    if (i >= count || nodes[i].other < i) return;
    uint number = starts[i];
    for (uint node = i;; node = nodes[node].split) {
        numbers[node] = number++;
        if (nodes[node].split == i) return;
    }
}

// --- nodes --------------------------------------------------------------------------------------

/// Writes an interior node over the places first..last whose number is known: children and box.
/// The leaf of a place is leaf number place + leaf_shift (modulo 2^32).
static void write_node(uint number, uint first, uint last, uint split, uint leaf_shift,
                       uint leaf_count, global const Box* levels, global uint2* children,
                       global Box* boxes) {
    const uint first_leaf = leaf_count - 1;
    const uint left = split == first ? first_leaf + first + leaf_shift : number + 1;
    const uint right =
        split + 1 == last ? first_leaf + last + leaf_shift : number + 1 + (split - first);
    children[number] = (uint2)(left, right);
    boxes[number] =
        range_box(boxes + first_leaf, levels, leaf_count, first + leaf_shift, last + leaf_shift);
}

kernel void lbvh_nodes(global const RadixNode* nodes,  // of the radix tree
                       global const uint* numbers,     // by node
                       uint leaf_count,                // one more than nodes
                       global const Box* levels,       // above the leaves' boxes
                       global uint2* children,         // by number: left, right
                       global Box* boxes)              // by number; those of leaves are there
{
    const uint i = (uint)get_global_id(0);
    if (i >= leaf_count - 1) return;
    const RadixNode node = nodes[i];
    write_node(numbers[i], min(i, node.other), max(i, node.other), node.split, 0, leaf_count,
               levels, children, boxes);
}
