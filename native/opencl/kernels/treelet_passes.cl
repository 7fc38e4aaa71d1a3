// SPDX-License-Identifier: GPL-3.0-or-later
// Which treelets are rebuilt at the same time, and what the tree costs.
//
// Work-items climb from leaves to the root. Where two meet, each leaves a number that is not 0 and
// takes what is there, by one atomic exchange: the first finds 0 and stops, the second goes on with
// both numbers. So nothing else needs to be seen by another work-group, and the result does not
// depend on who is first.

// --- reference counts ---------------------------------------------------------------------------

/// Sets the parents of all nodes but the root.
kernel void find_parents(global const uint2* children,  // by interior node
                         uint interior_count,           // interior nodes
                         global uint* parents,          // by node
                         global uint* arrived) {        // by interior node: 0 for a climb
    const uint node = (uint)get_global_id(0);
    if (node >= interior_count) return;
    parents[children[node].x] = node;
    parents[children[node].y] = node;
    arrived[node] = 0;
}

/// Counts the references below each interior node, from the leaves.
kernel void count_references(global const uint* parents,  // by node
                             uint interior_count,         // interior nodes, at least one
                             global uint* arrived,        // by interior node: 0
                             global uint* references) {   // by interior node
    const uint leaf = (uint)get_global_id(0);
    if (leaf > interior_count) return;
    uint node = interior_count + leaf, count = 1;
    while (node != 0) {
        const uint parent = parents[node], sibling = atomic_xchg(&arrived[parent], count);
        if (sibling == 0) return;
        count += sibling;
        references[parent] = count;
        node = parent;
    }
}

// --- levels -------------------------------------------------------------------------------------

/// Whether a node is a treelet's root in this pass: of at least gamma references.
static bool is_root(global const uint* references, uint interior_count, uint gamma, uint node) {
    return node < interior_count && references[node] >= gamma;
}

/// How many roots there are on the longest way from each root down, from the lowest ones. Roots of
/// one height have no other of them below.
kernel void find_heights(global const uint2* children,   // by interior node
                         global const uint* references,  // by interior node
                         global const uint* parents,     // by node
                         uint interior_count,            // interior nodes
                         uint gamma,                     // references of a root at least
                         global uint* arrived,           // by interior node: 0
                         global uint* heights,           // by interior node, of roots
                         global uint* roots_before) {    // by interior node: 1 for a root, else 0
    uint node = (uint)get_global_id(0);
    if (node >= interior_count) return;
    const bool starts = is_root(references, interior_count, gamma, node);
    roots_before[node] = starts;
    if (!starts || is_root(references, interior_count, gamma, children[node].x) ||
        is_root(references, interior_count, gamma, children[node].y))
        return;
    uint height = 0;
    heights[node] = 0;
    while (node != 0) {
        node = parents[node];
        ++height;
        const uint2 below = children[node];
        if (is_root(references, interior_count, gamma, below.x) &&
            is_root(references, interior_count, gamma, below.y)) {
            const uint other = atomic_xchg(&arrived[node], height);
            if (other == 0) return;
            height = max(height, other);
        }
        heights[node] = height;
    }
}

/// Lists the roots with their heights, in order of number.
kernel void list_roots(global const uint* references,    // by interior node
                       global const uint* heights,       // by interior node, of roots
                       global const uint* roots_before,  // by interior node: roots of lower number
                       uint interior_count,              // interior nodes
                       uint gamma,                       // references of a root at least
                       global uint* root_heights,        // by root
                       global uint* roots) {             // by root
    const uint node = (uint)get_global_id(0);
    if (!is_root(references, interior_count, gamma, node)) return;
    root_heights[roots_before[node]] = heights[node];
    roots[roots_before[node]] = node;
}

/// Finds where the roots of each height begin. Each height has some.
kernel void find_levels(global const uint* root_heights,  // by root, ascending
                        uint root_count,                  // how many
                        global uint* begins) {            // by height: the first root
    const uint i = (uint)get_global_id(0);
    if (i >= root_count) return;
    if (i == 0 || root_heights[i] != root_heights[i - 1]) begins[root_heights[i]] = i;
}

// --- sums ---------------------------------------------------------------------------------------
// Strand s adds up items s, s + strands, s + 2 strands ...: in an order that no group size changes.

kernel void sum_savings(global const double* savings,  // by root
                        uint root_count,               // how many
                        uint strands,                  // how many sums
                        global double* sums) {         // by strand
    const uint strand = (uint)get_global_id(0);
    if (strand >= strands) return;
    double sum = 0.0;
    for (uint i = strand; i < root_count; i += strands) sum += savings[i];
    sums[strand] = sum;
}

/// Half areas of the nodes, each times what it costs to visit it.
kernel void sum_costs(global const Box* boxes,  // by node
                      uint interior_count,      // interior nodes
                      double traversal,         // of an interior node
                      double intersection,      // of a leaf
                      uint strands,             // how many sums
                      global double* sums) {    // by strand
    const uint strand = (uint)get_global_id(0);
    if (strand >= strands) return;
    double sum = 0.0;
    for (ulong node = strand; node <= 2UL * interior_count; node += strands)
        sum += half_area(boxes[node]) * (node < interior_count ? traversal : intersection);
    sums[strand] = sum;
}
