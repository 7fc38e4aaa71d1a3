// SPDX-License-Identifier: GPL-3.0-or-later
// A treelet: the top of a subtree, TREELET_SIZE leaves under TREELET_SIZE - 1 interior nodes
// (Karras and Aila 2013). It is formed and given another topology by the work-items of one group,
// its lanes, which all call each of these functions; or, with ONE_LANE, by one work-item.
//
// Local memory is an argument of the kernels: PoCL 3.1 reads zeros from what a kernel declares and
// functions write. It also cannot compile barriers in groups of one or two.
//
// Its parts are numbered as on the host (build/treelet.h): 0 .. TREELET_SIZE - 1 are its leaves,
// and merge i makes part TREELET_SIZE + i. Every merge comes after those of its parts, the last
// makes the root.

#ifdef ONE_LANE
#define SHARED private
#define LANE 0U
#define LANES 1U
#define SYNCHRONISE()
#define SYNCHRONISE_TREE()
#define TREELET_OF_LAUNCH ((uint)get_global_id(0))
#else
#define SHARED local
#define LANE ((uint)get_local_id(0))
#define LANES ((uint)get_local_size(0))
#define SYNCHRONISE() barrier(CLK_LOCAL_MEM_FENCE)
#define SYNCHRONISE_TREE() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define TREELET_OF_LAUNCH ((uint)get_group_id(0))
#endif

#define MERGES (TREELET_SIZE - 1)
#define PARTS (2 * TREELET_SIZE - 1)
#define CLOSED (-1.0)  // area of a leaf of the tree, which cannot be opened

/// The tree, as DeviceBinary holds it.
typedef struct {
    global Box* boxes;        // by node, the leaves from first_leaf on
    global uint2* children;   // by interior node: left, right
    global uint* references;  // by interior node: how many are below it
    uint first_leaf;
} Tree;

typedef struct {
    double areas[TREELET_SIZE];    // half areas of the leaves or CLOSED; of what merges make later
    uint2 children[TREELET_SIZE];  // of the leaves that may be opened
    uint leaves[TREELET_SIZE];     // nodes of the tree
    uint interior[MERGES];         // nodes of the tree, the root first
    uint left[MERGES];             // the parts that a merge unites
    uint right[MERGES];
    float bounds[6][PARTS];  // by part: lower x, y, z, upper x, y, z
    uint references[PARTS];  // by part
} Treelet;

/// As glm::min and glm::max on the host, which keep the first of two zeros; fmin and fmax may not.
inline float lesser(float a, float b) {
    return b < a ? b : a;
}

inline float greater(float a, float b) {
    return a < b ? b : a;
}

static Box part_box(SHARED const Treelet* treelet, uint part) {
    Box box;
    for (uint axis = 0; axis < 3; ++axis) {
        box.lower[axis] = treelet->bounds[axis][part];
        box.upper[axis] = treelet->bounds[3 + axis][part];
    }
    return box;
}

// --- forming ------------------------------------------------------------------------------------

/// Makes a node the treelet's leaf at `place`. Called by one lane. What will be asked for if the
/// leaf is opened is read at once, so that reads wait for each other once a leaf, not twice.
static void put_leaf(Tree tree, SHARED Treelet* treelet, uint place, uint node) {
    const Box box = tree.boxes[node];
    const bool closed = node >= tree.first_leaf;
    treelet->leaves[place] = node;
    treelet->references[place] = closed ? 1 : tree.references[node];
    treelet->areas[place] = closed ? CLOSED : half_area(box);
    if (!closed) treelet->children[place] = tree.children[node];
    for (uint axis = 0; axis < 3; ++axis) {
        treelet->bounds[axis][place] = box.lower[axis];
        treelet->bounds[3 + axis][place] = box.upper[axis];
    }
}

static void put_leaves(Tree tree, SHARED Treelet* treelet, uint left_place, uint right_place,
                       uint2 nodes) {
    for (uint side = LANE; side < 2; side += LANES)
        put_leaf(tree, treelet, side == 0 ? left_place : right_place,
                 side == 0 ? nodes.x : nodes.y);
}

/// Opens the treelet leaf of largest area, the first of equal ones, until there are TREELET_SIZE.
/// Returns the half areas of the interior nodes below the root, added in the host's order.
static double form_treelet(Tree tree, uint root, SHARED Treelet* treelet) {
    if (LANE == 0) treelet->interior[0] = root;
    put_leaves(tree, treelet, 0, 1, tree.children[root]);
    SYNCHRONISE();

    double area = 0.0;
    for (uint count = 2; count < TREELET_SIZE; ++count) {
        // All lanes look for themselves: to read so few words costs less than to share a search.
        uint largest = 0;
        double largest_area = treelet->areas[0];
        for (uint place = 1; place < count; ++place) {
            const double other_area = treelet->areas[place];
            if (!(largest_area < other_area)) continue;
            largest_area = other_area;
            largest = place;
        }
        area += largest_area;
        const uint2 opened = treelet->children[largest];
        if (LANE == 0) treelet->interior[count - 1] = treelet->leaves[largest];
        SYNCHRONISE();
        put_leaves(tree, treelet, largest, count, opened);
        SYNCHRONISE();
    }
    return area;
}

// --- another topology ---------------------------------------------------------------------------

/// Finds boxes and reference counts of what the merges make. Returns the half areas of the interior
/// nodes below the root, added in the host's order.
static double measure(SHARED Treelet* treelet) {
    // Each coordinate depends on no other, nor do the counts.
    for (uint row = LANE; row < 7; row += LANES) {
        for (uint merge = 0; merge < MERGES; ++merge) {
            const uint left = treelet->left[merge], right = treelet->right[merge];
            const uint made = TREELET_SIZE + merge;
            if (row == 6) {
                treelet->references[made] = treelet->references[left] + treelet->references[right];
                continue;
            }
            SHARED float* bounds = treelet->bounds[row];
            bounds[made] = row < 3 ? lesser(bounds[left], bounds[right])
                                   : greater(bounds[left], bounds[right]);
        }
    }
    SYNCHRONISE();
    for (uint merge = LANE; merge + 1 < MERGES; merge += LANES)
        treelet->areas[merge] = half_area(part_box(treelet, TREELET_SIZE + merge));
    SYNCHRONISE_TREE();  // all lanes have read what replace_treelet overwrites
    double area = 0.0;
    for (uint merge = 0; merge + 1 < MERGES; ++merge) area += treelet->areas[merge];
    return area;
}

/// The interior node that a merge makes.
static uint made_node(SHARED const Treelet* treelet, uint merge) {
    return treelet->interior[merge + 1 == MERGES ? 0 : merge + 1];
}

static uint part_node(SHARED const Treelet* treelet, uint part) {
    return part < TREELET_SIZE ? treelet->leaves[part] : made_node(treelet, part - TREELET_SIZE);
}

/// Gives the treelet's interior nodes the topology that was measured.
static void replace_treelet(Tree tree, SHARED const Treelet* treelet) {
    for (uint merge = LANE; merge < MERGES; merge += LANES) {
        const uint node = made_node(treelet, merge), part = TREELET_SIZE + merge;
        tree.children[node] = (uint2)(part_node(treelet, treelet->left[merge]),
                                      part_node(treelet, treelet->right[merge]));
        tree.boxes[node] = part_box(treelet, part);
        tree.references[node] = treelet->references[part];
    }
}
