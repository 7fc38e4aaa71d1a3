// SPDX-License-Identifier: GPL-3.0-or-later
// The least cost of a wide tree with adaptive leaves over a binary tree: the dynamic programme of
// Ylitie, Karras, Laine 2017, section 3.1, as bvh/collapse.cpp, bit for bit.
//
// WIDTH is the branching factor: 2, 4 or 8. COMPRESSED is defined for compressed nodes.
//
// Nodes are planned bottom-up. A work-item goes up from a node whose children are planned, and at
// each parent it must know whether the sibling is planned, too. Karras 2012 lets the second to
// arrive go on, but OpenCL 1.2 does not say that it sees what the first one wrote in the same
// launch. So arrivals are stamped with the number of the launch. Where the sibling arrived in an
// earlier launch, its plan is visible and the work-item goes on. Where it arrived in this one,
// whoever is second puts the parent on the list of the next launch. A node then waits for as many
// launches as its Strahler number says, at most log2 of the number of references, however deep the
// tree is. Which nodes are on which list does not depend on who comes first; their order in a list
// does, and nothing depends on that.

// --- types --------------------------------------------------------------------------------------
// Lane j - 1 of Costs is C(N, j), the least cost of node N's subtree as at most j wide trees. The
// last lane is used where two children share out WIDTH trees only.

#if WIDTH == 8
typedef float8 Costs;
typedef int8 Shares;
#define LOAD vload8
#define STORE vstore8
#define NEXT_LANE(v) ((Costs)(INFINITY, v.s0123, v.s45, v.s6))
#define LANE_NUMBERS ((Shares)(0, 1, 2, 3, 4, 5, 6, 7))
#elif WIDTH == 4
typedef float4 Costs;
typedef int4 Shares;
#define LOAD vload4
#define STORE vstore4
#define NEXT_LANE(v) ((Costs)(INFINITY, v.s01, v.s2))
#define LANE_NUMBERS ((Shares)(0, 1, 2, 3))
#else
typedef float2 Costs;
typedef int2 Shares;
#define LOAD vload2
#define STORE vstore2
#define NEXT_LANE(v) ((Costs)(INFINITY, v.s0))
#define LANE_NUMBERS ((Shares)(0, 1))
#endif

/// What a parent has to know of a child.
typedef struct {
    Costs costs;
    uint size;  // references
    bool is_leaf;
} Subtree;

/// Constants of the cost (bvh/cost.h).
typedef struct {
    double scale;  // 1 / half area of the root, 0 where it has none
    float traversal, intersection;
    uint most_references;  // of a leaf
    uint first_leaf;       // number of interior nodes
} Model;

#define NO_NODE 0xFFFFFFFFU

// --- packed plans -------------------------------------------------------------------------------
// Four bits for each number of trees j = 1..7: how many of them the left child takes, 0 where all
// references make one leaf (j = 1), 15 where j trees are no better than j - 1. The highest four
// bits: the left child's trees where the node is a wide node. level_order.cl reads them.

#define FEWER 15U

static uint packed_share(uint share, uint trees) {
    return share << 4U * (trees - 1U);
}
static uint packed_node_share(uint share) {
    return share << 28U;
}

// --- the dynamic programme ----------------------------------------------------------------------

/// Triangle tests charged for a leaf (bvh/cost.h).
static float charged_tests(uint size) {
#if WIDTH == 2 || defined(COMPRESSED)
    return (float)size;
#else
    return (float)((size + WIDTH - 1U) / WIDTH * WIDTH);
#endif
}

/// Area relative to the root's.
static float relative_area(global const Box* boxes, uint node, Model model) {
    return model.scale > 0.0 ? (float)(half_area(boxes[node]) * model.scale) : 1.0F;
}

/// One step of sharing out: the left child takes `trees` trees.
static void try_share(float left, int trees, Costs right, Costs* best, Shares* share) {
    const Costs costs = left + right;
    const Shares better = costs < *best;
    *share = select(*share, (Shares)trees, better);
    *best = select(*best, costs, better);
}

/// Least cost of both subtrees as exactly j trees, in lane j - 1, and how many of these the left
/// one takes.
static Costs share_out(Subtree left, Subtree right, Shares* share) {
    if (left.is_leaf || right.is_leaf) {  // a leaf takes one tree: more do not help it
        *share = left.is_leaf ? (Shares)1 : LANE_NUMBERS;
        return left.is_leaf ? left.costs.s0 + NEXT_LANE(right.costs)
                            : NEXT_LANE(left.costs) + right.costs.s0;
    }
    Costs best = INFINITY;
    *share = 0;
    Costs shifted = NEXT_LANE(right.costs);  // lane j - 1: C(right, j - trees of the left)
    try_share(left.costs.s0, 1, shifted, &best, share);
#if WIDTH >= 4
    shifted = NEXT_LANE(shifted);
    try_share(left.costs.s1, 2, shifted, &best, share);
    shifted = NEXT_LANE(shifted);
    try_share(left.costs.s2, 3, shifted, &best, share);
#endif
#if WIDTH == 8
    shifted = NEXT_LANE(shifted);
    try_share(left.costs.s3, 4, shifted, &best, share);
    shifted = NEXT_LANE(shifted);
    try_share(left.costs.s4, 5, shifted, &best, share);
    shifted = NEXT_LANE(shifted);
    try_share(left.costs.s5, 6, shifted, &best, share);
    shifted = NEXT_LANE(shifted);
    try_share(left.costs.s6, 7, shifted, &best, share);
#endif
    return best;
}

/// Plans a node over two planned children.
static Subtree plan_node(Subtree left, Subtree right, float area, Model model, uint* plan) {
    Shares share;
    const Costs best = share_out(left, right, &share);
    float forest[WIDTH], costs[WIDTH];
    int shares[WIDTH];
    STORE(best, 0, forest);
    STORE(share, 0, shares);

    // One tree: a leaf of all references, or a wide node over a forest. A tie makes a leaf.
    const uint size = left.size + right.size;
    const float as_leaf = area * model.intersection * charged_tests(size);
    const float as_node = area * model.traversal + forest[WIDTH - 1];
    const bool leaf = as_leaf <= as_node && size <= model.most_references;
    const uint node_share = (uint)shares[WIDTH - 1];
    uint packed = packed_node_share(node_share) | packed_share(leaf ? 0U : node_share, 1U);
    float cost = leaf ? as_leaf : as_node;
    costs[0] = cost;

    // At most j trees: j - 1 of them where more do not help.
    for (uint j = 2; j < WIDTH; ++j) {
        const bool fewer = cost <= forest[j - 1];
        packed |= packed_share(fewer ? FEWER : (uint)shares[j - 1], j);
        cost = fewer ? cost : forest[j - 1];
        costs[j - 1] = cost;
    }
    costs[WIDTH - 1] = INFINITY;
    *plan = packed;
    return (Subtree){LOAD(0, costs), size, false};
}

/// A child that was planned in an earlier launch, or a leaf.
static Subtree planned(uint node, global const Box* boxes, global const float* costs,
                       global const uint2* plans, Model model) {
    if (node < model.first_leaf) return (Subtree){LOAD(node, costs), plans[node].y, false};
    const float cost = relative_area(boxes, node, model) * model.intersection * charged_tests(1U);
    return (Subtree){(Costs)cost, 1U, true};
}

// --- kernels ------------------------------------------------------------------------------------

/// Links children to their parents and lists the nodes that can be planned at once.
kernel void find_parents(global const uint2* children,  // by interior node
                         uint first_leaf,               // number of interior nodes
                         uint start,                    // node of the first work-item
                         global uint* parents,          // out: by node
                         global uint* ready,            // out: nodes over two leaves, in any order
                         global uint* ready_count)      // out: how many
{
    const uint node = start + (uint)get_global_id(0);
    if (node >= first_leaf) return;
    const uint2 pair = children[node];
    parents[pair.x] = node;
    parents[pair.y] = node;
    if (node == 0) parents[0] = NO_NODE;
    if (pair.x >= first_leaf && pair.y >= first_leaf) ready[atomic_inc(ready_count)] = node;
}

/// Plans nodes from those on the list upwards, each as far as children are planned, but
/// `most_steps` nodes at most, so that no launch takes long.
kernel void plan_upwards(global const uint2* children,  // by interior node
                         global const Box* boxes,       // by node
                         global const uint* parents,    // by node
                         Model model,                   //
                         global const uint* ready,      // nodes to begin with
                         uint ready_count,              // how many
                         uint start,                    // of them, that of the first work-item
                         uint launch,                   // number of this launch, from 1 on
                         uint most_steps,               //
                         global uint* arrived,  // by interior node: launch of the last arrival
                                                // from below, 0 at first
                         global uint2* plans,   // out: packed plan and number of references
                         global float* costs,   // out: WIDTH for each node where a work-item ended
                         global uint* next,     // out: nodes for the next launch, in any order
                         global uint* next_count)  // out: how many
{
    const uint i = start + (uint)get_global_id(0);
    if (i >= ready_count) return;
    uint node = ready[i];
    uint2 pair = children[node];
    Subtree left = planned(pair.x, boxes, costs, plans, model);
    Subtree right = planned(pair.y, boxes, costs, plans, model);
    for (uint step = 1;; ++step) {
        uint plan;
        const Subtree done =
            plan_node(left, right, relative_area(boxes, node, model), model, &plan);
        plans[node] = (uint2)(plan, done.size);
        const uint parent = parents[node];
        if (parent == NO_NODE) return;

        pair = children[parent];
        const bool is_left = pair.x == node;
        const uint sibling = is_left ? pair.y : pair.x;
        bool goes_on = true, is_second = false;
        if (sibling < model.first_leaf) {
            const uint arrival = atomic_xchg(&arrived[parent], launch);
            goes_on = arrival != 0U && arrival != launch;
            is_second = arrival == launch;
        }
        if (!goes_on || step == most_steps) {
            STORE(done.costs, node, costs);
            if (goes_on || is_second) next[atomic_inc(next_count)] = parent;
            return;
        }
        const Subtree other = planned(sibling, boxes, costs, plans, model);
        left = is_left ? done : other;
        right = is_left ? other : done;
        node = parent;
    }
}
