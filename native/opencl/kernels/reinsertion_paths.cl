// SPDX-License-Identifier: GPL-3.0-or-later
// Ways up and down a tree of pairs, with no work-item waiting for another of its launch.
//
// Bottom-up passes with counters (Karras 2012, section 4: whoever comes to a node second goes on)
// need what another work-group has just written, and OpenCL 1.2 orders memory between groups only
// from launch to launch. So whoever comes second goes on only where the first came in an *earlier*
// launch; else the node is where a work-item of the next launch begins. The launches that takes are
// the Strahler number of the tree: a pair of two leaves has rank 1, a pair whose children have
// ranks a != b max(a, b), one of equal ranks a + 1. A subtree of rank r has 2^r leaves at least, so
// there are at most log2(n) launches, and n / 2^r begin in launch r, however deep the tree is.
//
// Pairs of equal rank, one below the other, are a path, which one work-item walks. Top-down passes
// walk the same paths downwards, highest rank first.

#define NO_PAIR 0xFFFFFFFFU

/// Where a pair comes in depth-first order: its number among pairs, from 1 on, and that of the
/// first leaf below it among leaves.
typedef uint2 Place;

static uint size_of(global const uint* sizes, uint child) {
    return is_leaf(child) ? 0 : sizes[child];
}

// --- upwards ------------------------------------------------------------------------------------

#ifdef EXACT_BOXES
// The box of each pair's node in the coordinates of the scene, from those of the base's leaves.
#define VISIT_PARAMETERS global const Box *leaf_boxes, uint first_leaf, global Box *pair_boxes,
#define VISIT_ARGUMENTS leaf_boxes, first_leaf, pair_boxes,

/// As glm::min and glm::max do it on the host, which decides between +0 and -0.
static Box unite_exact(Box a, Box b) {
    for (int axis = 0; axis < 3; ++axis) {
        a.lower[axis] = b.lower[axis] < a.lower[axis] ? b.lower[axis] : a.lower[axis];
        a.upper[axis] = a.upper[axis] < b.upper[axis] ? b.upper[axis] : a.upper[axis];
    }
    return a;
}

static Box exact_box(global const Box* leaf_boxes, uint first_leaf, global const Box* pair_boxes,
                     uint child) {
    return is_leaf(child) ? leaf_boxes[first_leaf + (child & ~LEAF_FLAG)] : pair_boxes[child];
}

static void visit(VISIT_PARAMETERS global SlotPair* pairs, uint pair, uint slot) {
    const uint2 child = pairs[pair].child;
    pair_boxes[pair] = unite_exact(exact_box(leaf_boxes, first_leaf, pair_boxes, child.x),
                                   exact_box(leaf_boxes, first_leaf, pair_boxes, child.y));
}
#else
// Boxes and areas in the slots above.
#define VISIT_PARAMETERS
#define VISIT_ARGUMENTS

static void visit(global SlotPair* pairs, uint pair, uint slot) {
    const BoxPair boxes = pairs[pair].boxes;
    set_box(&pairs[slot >> 1], slot & 1, unite_pairs(boxes, swap_sides(boxes)));
}
#endif

/// Visits the pairs of a path and returns the last one, its top.
static uint walk_up(
    VISIT_PARAMETERS                 // of the program's visit
        global SlotPair* pairs,      // the tree
    global const uint* parents,      // by pair
    global uint* sizes,              // pairs in the subtree, by pair
    global uchar* ranks,             // by pair
    volatile global uint* arrivals,  // rank of the first to come from below; 0: none
    uint pair, uint rank,            // where the path begins, and its rank
    global uint* next,               // gets first pairs of the next rank
    volatile global uint* next_count) {
    for (;;) {
        const uint2 child = pairs[pair].child;
        sizes[pair] = 1 + size_of(sizes, child.x) + size_of(sizes, child.y);
        ranks[pair] = (uchar)rank;
        const uint slot = parents[pair];
        visit(VISIT_ARGUMENTS pairs, pair, slot);
        if (slot == ROOT) return pair;
        const uint parent = slot >> 1;
        if (!is_leaf(child_of(pairs, slot ^ 1))) {
            const uint arrived = atomic_cmpxchg(&arrivals[parent], 0, rank);
            if (arrived == rank) next[atomic_inc(next_count)] = parent;
            if (arrived == 0 || arrived == rank) return pair;
        }
        pair = parent;
    }
}

/// Rank 1: paths begin at all pairs of two leaves.
kernel void walk_up_from_leaves(VISIT_PARAMETERS global SlotPair* pairs,  // as above
                                global const uint* parents,               // as above
                                global uint* sizes,                       // as above
                                global uchar* ranks,                      // as above
                                volatile global uint* arrivals,           // by pair, all 0 before
                                uint count,                               // pairs
                                uint next_first,     // where the next rank begins in `paths`
                                global uint* paths,  // tops by first pair, or NO_PAIR
                                volatile global uint* path_counts)  // by rank, all 0 before
{
    const uint pair = get_global_id(0);
    if (pair >= count) return;
    if (pair == 0) path_counts[1] = count;
    const uint2 child = pairs[pair].child;
    paths[pair] = pair > 0 && is_leaf(child.x) && is_leaf(child.y)
                      ? walk_up(VISIT_ARGUMENTS pairs, parents, sizes, ranks, arrivals, pair, 1,
                                paths + next_first, &path_counts[2])
                      : NO_PAIR;
}

/// The other ranks: paths begin where two of the rank below met.
kernel void walk_up_from_paths(VISIT_PARAMETERS global SlotPair* pairs,  // as above
                               global const uint* parents,               // as above
                               global uint* sizes,                       // as above
                               global uchar* ranks,                      // as above
                               volatile global uint* arrivals,           // as above
                               uint rank,                                // of these paths
                               uint first,          // where they are in `paths`
                               uint next_first,     // where the next rank begins
                               global uint* paths,  // first pairs; the tops take their places
                               volatile global uint* path_counts)  // by rank
{
    const uint path = get_global_id(0);
    if (path >= path_counts[rank]) return;
    paths[first + path] =
        walk_up(VISIT_ARGUMENTS pairs, parents, sizes, ranks, arrivals, paths[first + path], rank,
                paths + next_first, &path_counts[rank + 1]);
}

// --- downwards ----------------------------------------------------------------------------------

static Place child_place(Place place, uint2 child, uint side, global const uint* sizes) {
    const uint left = side == 0 ? 0 : size_of(sizes, child.x);
    return (Place)(place.x + 1 + left, side == 0 ? place.y : place.y + left + 1);
}

/// Places all pairs of a rank in depth-first order, left child first; those of higher ranks have
/// their places.
kernel void walk_down(global const SlotPair* pairs,    // the tree
                      global const uint* parents,      // by pair
                      global const uint* sizes,        // pairs in the subtree, by pair
                      global const uchar* ranks,       // by pair
                      uint rank,                       // of the paths
                      uint first,                      // where they are in `paths`
                      global const uint* paths,        // their tops, or NO_PAIR
                      global const uint* path_counts,  // by rank
                      global Place* places)            // by pair
{
    const uint path = get_global_id(0);
    if (path >= path_counts[rank]) return;
    uint pair = paths[first + path];
    if (pair == NO_PAIR) return;
    const uint slot = parents[pair], parent = slot >> 1;
    Place place = (Place)(1, 0);
    if (slot != ROOT) place = child_place(places[parent], pairs[parent].child, slot & 1, sizes);
    for (;;) {
        places[pair] = place;
        const uint2 child = pairs[pair].child;
        const bool left = !is_leaf(child.x) && ranks[child.x] == rank;
        if (!left && (is_leaf(child.y) || ranks[child.y] != rank)) return;
        place = child_place(place, child, left ? 0 : 1, sizes);
        pair = left ? child.x : child.y;
    }
}
