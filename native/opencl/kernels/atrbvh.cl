// SPDX-License-Identifier: GPL-3.0-or-later
// Agglomerative treelet restructuring (Domingues and Pedrini 2015): a treelet's leaves are
// clustered anew. Stands behind treelet.cl; mirrors build/atrbvh.cpp and build/agglomeration.cpp.

#define SLOTS ((TREELET_SIZE + 7) / 8 * 8)  // whole vectors, where a compiler makes them
#define NO_PART 0xFFU
#define NO_SLOT 0xFFU
#define INFINITE_AREA 0x7F800000U  // bits of infinity

// Areas that a lane finds at a time.
#ifdef ONE_LANE
#define VALUES 8U
#define LOAD_VALUES(from) vload8(0, from)
#define STORE_BITS(bits, to) vstore8(bits, 0, to)
#define AS_BITS(values) as_uint8(values)
typedef float8 Values;
#else
#define VALUES 1U
#define LOAD_VALUES(from) (*(from))
#define STORE_BITS(bits, to) (*(to) = (bits))
#define AS_BITS(values) as_uint(values)
typedef float Values;
#endif

/// Clusters in slots; a slot without one holds a box without bounds, whose union with any other has
/// infinite area.
typedef struct {
    float bounds[6][SLOTS];  // lower x, y, z, upper x, y, z, in units of the treelet's root
    uint areas[SLOTS];       // of the unions with one slot: bits, which order as the areas do
    uint parts[SLOTS];       // what a cluster is called, or NO_PART
    uint chain[SLOTS];       // slots, each the nearest of the one before
} Clusters;

typedef struct {
    Treelet treelet;
    Clusters clusters;
} Workspace;

// LOCAL_BYTES is what the host provides.
typedef char workspace_fits[sizeof(Workspace) <= LOCAL_BYTES ? 1 : -1];

// --- clusters -----------------------------------------------------------------------------------

/// A power of two that brings a box's longest side to 1..2; 1 for a point. Taken from the bits: the
/// difference of two floats is never subnormal in double, nor are powers of this size.
static double unit_scale(Box box) {
    double longest = 0.0;
    for (uint axis = 0; axis < 3; ++axis)
        longest = fmax(longest, (double)box.upper[axis] - (double)box.lower[axis]);
    if (!(longest > 0.0)) return 1.0;
    const ulong exponent = as_ulong(longest) >> 52;
    return as_double((2046UL - exponent) << 52);
}

inline float unbounded(uint row) {
    return row < 3 ? -INFINITY : INFINITY;
}

/// Makes each leaf of the treelet a cluster, in units of its root: areas fit into float.
static void load_clusters(SHARED const Treelet* treelet, Box root, SHARED Clusters* clusters) {
    const double scale = unit_scale(root);
    for (uint slot = LANE; slot < SLOTS; slot += LANES) {
        const bool used = slot < TREELET_SIZE;
        for (uint row = 0; row < 6; ++row)
            clusters->bounds[row][slot] =
                used ? (float)((double)treelet->bounds[row][slot] * scale) : unbounded(row);
        clusters->parts[slot] = used ? slot : NO_PART;
    }
    SYNCHRONISE();
}

/// Extents of the unions of the cluster in `slot` with the clusters from slot `first` on.
static Values union_extents(SHARED const Clusters* clusters, uint axis, uint slot, uint first) {
    const Values lower = clusters->bounds[axis][slot];
    const Values upper = clusters->bounds[3 + axis][slot];
    const Values other_lower = LOAD_VALUES(&clusters->bounds[axis][first]);
    const Values other_upper = LOAD_VALUES(&clusters->bounds[3 + axis][first]);
    return (upper < other_upper ? other_upper : upper) -
           (other_lower < lower ? other_lower : lower);
}

/// The area of the union of every cluster with the one in `slot`; infinite for itself.
static void find_areas(SHARED Clusters* clusters, uint slot) {
    for (uint first = LANE * VALUES; first < SLOTS; first += LANES * VALUES) {
        const Values x = union_extents(clusters, 0, slot, first);
        const Values y = union_extents(clusters, 1, slot, first);
        const Values z = union_extents(clusters, 2, slot, first);
        // Never -0, whose bits are in the wrong order.
        const Values areas = x * y + z * (x + y) + 0.0F;
        STORE_BITS(AS_BITS(areas), &clusters->areas[first]);
    }
    if (LANE == slot / VALUES % LANES) clusters->areas[slot] = INFINITE_AREA;
}

/// The slot of least area, the first of equal ones, but `preferred` if it is one of them. All
/// lanes look for themselves.
static uint find_nearest(SHARED const Clusters* clusters, uint preferred) {
    uint least = INFINITE_AREA, nearest = NO_SLOT;
    for (uint i = 0; i < SLOTS; ++i) least = min(least, clusters->areas[i]);
    if (preferred != NO_SLOT && clusters->areas[preferred] == least) return preferred;
    for (uint i = 0; i < SLOTS; ++i)
        nearest = min(nearest, clusters->areas[i] == least ? i : NO_SLOT);
    return nearest;
}

/// Unites two clusters to one, in the lower slot.
static void merge_clusters(SHARED Clusters* clusters, SHARED Treelet* treelet, uint merge, uint a,
                           uint b) {
    const uint kept = min(a, b), emptied = max(a, b);
    for (uint row = LANE; row < 7; row += LANES) {
        if (row == 6) {
            treelet->left[merge] = clusters->parts[kept];
            treelet->right[merge] = clusters->parts[emptied];
            clusters->parts[kept] = TREELET_SIZE + merge;
            clusters->parts[emptied] = NO_PART;
            continue;
        }
        SHARED float* bounds = clusters->bounds[row];
        bounds[kept] = row < 3 ? lesser(bounds[kept], bounds[emptied])
                               : greater(bounds[kept], bounds[emptied]);
        bounds[emptied] = unbounded(row);
    }
}

// --- clustering ---------------------------------------------------------------------------------

/// Merges the pair whose union has the least area until one cluster is left. A chain from one
/// cluster to its nearest, and so on, ends in two that are nearest to each other; they stay so
/// whatever else is merged, and may be merged at once (build/agglomeration.cpp).
static void agglomerate(SHARED Clusters* clusters, SHARED Treelet* treelet) {
    // The end of the chain, the same in all lanes.
    uint length = 0, slot = 0, before = NO_SLOT, last = TREELET_SIZE - 1;
    for (uint merge = 0; merge < MERGES;) {
        if (length == 0) {
            while (clusters->parts[last] == NO_PART) --last;
            slot = last;
            before = NO_SLOT;
            length = 1;
            if (LANE == 0) clusters->chain[0] = slot;
        }
        find_areas(clusters, slot);
        SYNCHRONISE();
        const uint nearest = find_nearest(clusters, before);
        if (nearest == before) {
            merge_clusters(clusters, treelet, merge, slot, before);
            ++merge;
            length -= 2;
            slot = length > 0 ? clusters->chain[length - 1] : NO_SLOT;
            before = length > 1 ? clusters->chain[length - 2] : NO_SLOT;
        } else {
            before = slot;
            slot = nearest;
            if (LANE == 0) clusters->chain[length] = slot;
            ++length;
        }
        SYNCHRONISE();
    }
}

// --- kernel -------------------------------------------------------------------------------------

/// Clusters the treelets under some roots anew and keeps what costs less. What is below a treelet's
/// leaves costs the same either way, and so do the leaves and the root: the interior nodes between
/// decide. No root may be below another.
kernel void agglomerate_treelets(global Box* boxes,         // of the tree, by node
                                 global uint2* children,    // by interior node
                                 global uint* references,   // by interior node: how many below it
                                 uint first_leaf,           // number of the tree's first leaf
                                 global const uint* roots,  // of treelets
                                 uint first_root,           // place in `roots` of the first treelet
                                 uint end_root,             // and behind the last
                                 global double* savings,    // of area, by place in `roots`
                                 local Workspace* shared) {  // LOCAL_BYTES for a group of lanes
#ifdef ONE_LANE
    Workspace own;
private
    Workspace* const space = &own;
#else
    local Workspace* const space = shared;
#endif
    const Tree tree = {boxes, children, references, first_leaf};
    const uint place = first_root + TREELET_OF_LAUNCH;
    if (place >= end_root) return;
    const uint root = roots[place];

    const double area = form_treelet(tree, root, &space->treelet);
    load_clusters(&space->treelet, boxes[root], &space->clusters);
    agglomerate(&space->clusters, &space->treelet);
    const double clustered_area = measure(&space->treelet);
    const bool better = clustered_area < area;
    if (better) replace_treelet(tree, &space->treelet);
    if (LANE == 0) savings[place] = better ? area - clustered_area : 0.0;
}
