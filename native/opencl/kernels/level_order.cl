// SPDX-License-Identifier: GPL-3.0-or-later
// Reads the plans of collapse.cl top-down, one level at a time, to find each wide node's children
// and where they go, as bvh/level_order.h.
//
// WIDTH is the branching factor: 2, 4 or 8; LANES the references of a block. COMPRESSED is defined
// for compressed nodes, whose children stand in order of slots (compress.cl).

// --- children of wide nodes ---------------------------------------------------------------------
// WIDTH numbers for each wide node: a binary node, IS_LEAF with it where all its references make
// one leaf, or NO_CHILD.

#define NO_CHILD 0xFFFFFFFFU
#define IS_LEAF 0x80000000U
#define NO_NODE 0xFFFFFFFFU

static bool is_missing(uint child) {
    return child == NO_CHILD;
}
static bool is_leaf(uint child) {
    return child != NO_CHILD && (child & IS_LEAF) != 0U;
}
static bool is_interior(uint child) {
    return (child & IS_LEAF) == 0U;
}
static uint binary_node(uint child) {
    return child & ~IS_LEAF;
}

/// The binary tree with its plans.
typedef struct {
    global const uint2* children;  // by interior node
    global const uint2* plans;     // packed plan and number of references, by interior node
    global const Box* boxes;       // by node
    uint first_leaf;               // number of interior nodes
} Planned;

/// References below a binary node.
static uint size_below(Planned tree, uint node) {
    return node >= tree.first_leaf ? 1U : tree.plans[node].y;
}
static uint blocks_of(uint size) {
    return (size + LANES - 1U) / LANES;
}

/// Blocks of a leaf that one work-item lists: a leaf has 512 such runs at most, as the way to the
/// first reference of each may be as long as the leaf has references.
static uint run_of(uint size) {
    return max(16U, (blocks_of(size) + 511U) / 512U);
}

// --- opening ------------------------------------------------------------------------------------

#define FEWER 15U

/// How many of `trees` trees the left child takes (collapse.cl packs them).
static uint left_share(uint plan, uint trees) {
    return plan >> 4U * (trees - 1U) & 15U;
}
static uint node_share(uint plan) {
    return plan >> 28U;
}

#ifdef COMPRESSED
/// Puts the children into the slots that they take (compress.cl).
void arrange(global const Box* boxes, uint* opened);
#endif

/// Finds the WIDTH children of the wide node over a binary node, from left to right, or by slot.
static void open_wide_node(Planned tree, uint root, uint* opened) {
    for (uint c = 0; c < WIDTH; ++c) opened[c] = NO_CHILD;
    if (root >= tree.first_leaf) {  // a tree of a single reference
        opened[0] = root | IS_LEAF;
    } else {
        // Nodes to represent, with the number of their trees in the bits that no node number has.
        uint pending[WIDTH];
        const uint2 pair = tree.children[root];
        const uint share = node_share(tree.plans[root].x);
        pending[0] = pair.y | (WIDTH - share) << 29U;
        pending[1] = pair.x | share << 29U;
        uint count = 0;
        for (uint left = 2; left > 0;) {
            const uint node = pending[--left] & 0x1FFFFFFFU;
            uint trees = pending[left] >> 29U;
            bool leaf = true;
            if (node < tree.first_leaf) {
                const uint plan = tree.plans[node].x;
                while (left_share(plan, trees) == FEWER) --trees;
                if (trees > 1U) {
                    const uint2 below = tree.children[node];
                    const uint first = left_share(plan, trees);
                    pending[left++] = below.y | (trees - first) << 29U;
                    pending[left++] = below.x | first << 29U;
                    continue;
                }
                leaf = left_share(plan, 1U) == 0U;
            }
            opened[count++] = leaf ? node | IS_LEAF : node;
        }
    }
#ifdef COMPRESSED
    arrange(tree.boxes, opened);
#endif
}

/// Opens wide node `wide` and says how many of its children are interior nodes.
static uint open_one(Planned tree, uint wide, global const uint* roots, global uint* opened,
                     global uint* blocks) {
    uint children[WIDTH];
    open_wide_node(tree, roots[wide], children);
    uint interior = 0, leaf_blocks = 0;
    for (uint c = 0; c < WIDTH; ++c) {
        const uint child = children[c];
        opened[(size_t)wide * WIDTH + c] = child;
        if (is_interior(child)) ++interior;
        if (is_leaf(child)) leaf_blocks += blocks_of(size_below(tree, binary_node(child)));
    }
    blocks[wide] = leaf_blocks;
    return interior;
}

/// Numbers the interior children of wide node `wide` from `next` on.
static void number_children(uint wide, uint next, global const uint* opened,
                            global uint* first_child, global uint* roots) {
    first_child[wide] = next;
    for (uint c = 0; c < WIDTH; ++c) {
        const uint child = opened[(size_t)wide * WIDTH + c];
        if (is_interior(child)) roots[next++] = child;
    }
}

// --- kernels: levels ----------------------------------------------------------------------------

/// Opens the wide nodes of one level.
kernel void open_level(global const uint2* children,  // of the binary tree
                       global const uint2* plans,     // of its interior nodes
                       global const Box* boxes,       // of its nodes
                       uint first_leaf,               // number of its interior nodes
                       uint first,                    // wide node of the level
                       uint count,                    // wide nodes of the level
                       uint start,                    // of these, that of the first work-item
                       global const uint* roots,      // binary node of each wide node
                       global uint* opened,           // out: children, WIDTH for each wide node
                       global uint* blocks,           // out: blocks of its leaves, by wide node
                       global uint* interior)         // out: interior children, by node of level
{
    const uint i = start + (uint)get_global_id(0);
    if (i >= count) return;
    const Planned tree = {children, plans, boxes, first_leaf};
    interior[i] = open_one(tree, first + i, roots, opened, blocks);
}

/// Numbers the wide nodes of the next level.
kernel void number_level(uint first,                 // wide node of the level
                         uint count,                 // wide nodes of the level
                         uint start,                 // of these, that of the first work-item
                         global const uint* before,  // interior children of the nodes before it in
                                                     // the level
                         global const uint* opened,  // children, WIDTH for each wide node
                         global uint* first_child,   // out: by wide node
                         global uint* roots)         // out: binary nodes of the next level
{
    const uint i = start + (uint)get_global_id(0);
    if (i >= count) return;
    number_children(first + i, first + count + before[i], opened, first_child, roots);
}

/// Does both for one level after another, as long as a level has no more nodes than the group has
/// work-items: a deep tree would take a launch or two for each of thousands of small levels. For
/// one group: work-items of a group see at a barrier what the others wrote.
kernel void open_narrow_levels(global const uint2* children,  // of the binary tree
                               global const uint2* plans,     // of its interior nodes
                               global const Box* boxes,       // of its nodes
                               uint first_leaf,               // number of its interior nodes
                               uint first,                    // wide node of the first level
                               uint count,                    // wide nodes of the first level
                               uint most_levels,              //
                               global uint* roots,            // binary node of each wide node
                               global uint* opened,           // out: as open_level
                               global uint* blocks,           // out: as open_level
                               global uint* first_child,      // out: as number_level
                               global uint* state,  // out: first and count of the level that comes
                                                    // next, and the number of levels opened
                               local uint* sums)    // a number for each work-item
{
    const Planned tree = {children, plans, boxes, first_leaf};
    const uint lane = (uint)get_local_id(0), lanes = (uint)get_local_size(0);
    uint levels = 0;
    while (count > 0 && count <= lanes && levels < most_levels) {
        uint interior = 0;
        if (lane < count) interior = open_one(tree, first + lane, roots, opened, blocks);
        sums[lane] = interior;
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        for (uint step = 1; step < lanes; step *= 2) {  // inclusive sums (Hillis & Steele 1986)
            const uint before = lane >= step ? sums[lane - step] : 0U;
            barrier(CLK_LOCAL_MEM_FENCE);
            sums[lane] += before;
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        const uint next = first + count;
        if (lane < count)
            number_children(first + lane, next + sums[lane] - interior, opened, first_child, roots);
        first = next;
        count = sums[lanes - 1];
        ++levels;
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    }
    if (lane == 0) {
        state[0] = first;
        state[1] = count;
        state[2] = levels;
    }
}

// --- kernels: leaves ----------------------------------------------------------------------------

/// Notes for the first block of each run which leaf it is of, and which of its blocks it is; for
/// other blocks nothing. Adds up the tree's leaves.
kernel void find_leaves(global const uint2* plans,  // of the binary tree's interior nodes
                        uint first_leaf,            // number of these
                        uint count,                 // wide nodes
                        uint start,                 // of these, that of the first work-item
                        global const uint* opened,  // children, WIDTH for each wide node
                        global const uint* blocks,  // first block of its leaves, by wide node
                        global uint2* heads,        // out: binary node and number, by block
                        global uint* leaf_count,    // out: added to
                        global uint* largest_leaf)  // out: raised to its references
{
    local uint group_leaves, group_largest;
    if (get_local_id(0) == 0) group_leaves = group_largest = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint wide = start + (uint)get_global_id(0);
    if (wide < count) {
        const Planned tree = {0, plans, 0, first_leaf};
        uint block = blocks[wide], leaves = 0, largest = 0;
        for (uint c = 0; c < WIDTH; ++c) {
            const uint child = opened[(size_t)wide * WIDTH + c];
            if (!is_leaf(child)) continue;
            const uint size = size_below(tree, binary_node(child));
            for (uint i = 0; i < blocks_of(size); i += run_of(size))
                heads[block + i] = (uint2)(binary_node(child), i);
            block += blocks_of(size);
            ++leaves;
            largest = max(largest, size);
        }
        atomic_add(&group_leaves, leaves);
        atomic_max(&group_largest, largest);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0) {
        atomic_add(leaf_count, group_leaves);
        atomic_max(largest_leaf, group_largest);
    }
}

/// What a lane of a block holds.
#ifdef COMPRESSED
/// Blocks are single references of leaves of at most three: the triangle in 28 bits, which of the
/// leaf's references it is, and how many there are, less one.
static uint lane_of(uint triangle, uint lane, uint size) {
    return triangle | lane << 28U | (size - 1U) << 30U;
}
#else
/// A triangle, with the highest bit where the lane is unused and repeats the one before it.
static uint lane_of(uint triangle, uint lane, uint size) {
    return lane < size ? triangle : triangle | 0x80000000U;
}
#endif

/// Lists the references of leaves depth-first, a run to a work-item. Without a stack: a walk
/// goes up by the parents, so that it takes steps in proportion to the references it lists, and at
/// first as many as the leaf's subtree is deep.
kernel void list_references(global const uint2* children,   // of the binary tree
                            global const uint2* plans,      // of its interior nodes
                            global const uint* parents,     // of its nodes
                            global const uint* references,  // of its leaves
                            uint first_leaf,                // number of its interior nodes
                            global const uint2* heads,      // by block, of find_leaves
                            uint block_count,               //
                            uint start,                     // block of the first work-item
                            global uint* lanes)             // out: LANES for each block
{
    const uint block = start + (uint)get_global_id(0);
    if (block >= block_count) return;
    const uint2 head = heads[block];
    if (head.x == NO_NODE) return;
    const Planned tree = {children, plans, 0, first_leaf};
    const uint size = size_below(tree, head.x);
    const uint first = head.y * LANES;
    const uint end = min(size, first + run_of(size) * LANES);
    global uint* const out = lanes + (size_t)block * LANES;

    uint node = head.x;
    for (uint skip = first; node < first_leaf;) {  // down to the first reference
        const uint2 pair = children[node];
        const uint on_the_left = skip == 0 ? 1U : size_below(tree, pair.x);
        node = skip < on_the_left ? pair.x : pair.y;
        if (node == pair.y) skip -= on_the_left;
    }
    uint triangle = references[node - first_leaf];
    uint i = first;
    for (;;) {
        out[i - first] = lane_of(triangle, i, size);
        if (++i == end) break;
        uint2 pair;
        for (bool from_right = true; from_right;) {
            const uint child = node;
            node = parents[node];
            pair = children[node];
            from_right = pair.y == child;
        }
        node = pair.y;
        while (node < first_leaf) node = children[node].x;
        triangle = references[node - first_leaf];
    }
    for (; i % LANES != 0; ++i) out[i - first] = lane_of(triangle, i, size);
}
