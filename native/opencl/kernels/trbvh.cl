// SPDX-License-Identifier: GPL-3.0-or-later
// Treelet restructuring (Karras and Aila 2013): a treelet's optimal topology by dynamic programming
// over all sets of its leaves. Stands behind treelet.cl; mirrors build/trbvh.cpp.
//
// A set is a number with a bit per leaf. Costs are in units of area.

#define SETS (1U << TREELET_SIZE)
#define ALL_LEAVES (SETS - 1)

/// The sets by number of leaves, and by number among those of as many; from the host.
typedef struct {
    uint begins[TREELET_SIZE + 2];  // where those of so many leaves begin in `sets`
    uint sets[SETS];
} SetOrder;

/// Constants of the surface area heuristic (bvh/cost.h).
typedef struct {
    double traversal;
    double intersection;
} CostModel;

/// What there is to know of each set, by set.
typedef struct {
    double costs[SETS];     // the least, with all that is below
    float bounds[6][SETS];  // lower x, y, z, upper x, y, z
    uint references[SETS];
    uchar parts[SETS];  // of the best division, the part with the set's first leaf
    uint made[MERGES];  // the sets that merges make
} Sets;

typedef struct {
    Sets sets;
    Treelet treelet;
} Workspace;

// LOCAL_BYTES is what the host provides.
typedef char workspace_fits[sizeof(Workspace) <= LOCAL_BYTES ? 1 : -1];

// --- costs of the tree --------------------------------------------------------------------------

/// Of a node with all that is below, as a leaf where that is less.
static double node_cost(CostModel model, double area, double below, uint references) {
    const double as_node = model.traversal * area + below;
    const double as_leaf = model.intersection * area * (double)references;
    return as_leaf < as_node ? as_leaf : as_node;
}

/// Of a node of the tree as it stands in `costs`, which has the interior ones.
static double known_cost(Tree tree, global const double* costs, CostModel model, uint node) {
    return node >= tree.first_leaf ? model.intersection * half_area(tree.boxes[node]) : costs[node];
}

/// Of an interior node, from those of its children.
static double updated_cost(Tree tree, global const double* costs, CostModel model, uint node) {
    const uint2 children = tree.children[node];
    const double below =
        known_cost(tree, costs, model, children.x) + known_cost(tree, costs, model, children.y);
    return node_cost(model, half_area(tree.boxes[node]), below, tree.references[node]);
}

// --- sets ---------------------------------------------------------------------------------------

/// Fills in boxes and reference counts of all sets, and the costs of those of one leaf.
static void load_sets(Tree tree, global const double* costs, CostModel model,
                      SHARED const Treelet* treelet, SHARED Sets* sets) {
    if (LANE == 0) {
        for (uint row = 0; row < 6; ++row) sets->bounds[row][0] = row < 3 ? INFINITY : -INFINITY;
        sets->references[0] = 0;
    }
    for (uint leaf = LANE; leaf < TREELET_SIZE; leaf += LANES)
        sets->costs[1U << leaf] = known_cost(tree, costs, model, treelet->leaves[leaf]);
    SYNCHRONISE();

    // The sets with this leaf and no later one, from those without it.
    for (uint leaf = 0; leaf < TREELET_SIZE; ++leaf) {
        const uint single = 1U << leaf;
        for (uint row = 0; row < 6; ++row) {
            const float bound = treelet->bounds[row][leaf];
            SHARED float* bounds = sets->bounds[row];
            for (uint set = LANE; set < single; set += LANES)
                bounds[single + set] =
                    row < 3 ? lesser(bounds[set], bound) : greater(bounds[set], bound);
        }
        for (uint set = LANE; set < single; set += LANES)
            sets->references[single + set] = sets->references[set] + treelet->references[leaf];
        SYNCHRONISE();
    }
}

static double set_area(SHARED const Sets* sets, uint set) {
    Box box;
    for (uint axis = 0; axis < 3; ++axis) {
        box.lower[axis] = sets->bounds[axis][set];
        box.upper[axis] = sets->bounds[3 + axis][set];
    }
    return half_area(box);
}

/// The least cost of a set of two or more leaves from those of its parts: of all ways to divide it,
/// each named by the part that has the set's first leaf.
static void find_cost(CostModel model, SHARED Sets* sets, uint set) {
    const uint others = set & (set - 1), first = set ^ others;
    double least = INFINITY;
    uint best = 0, part = others;
    do {
        part = (part - 1) & others;
        const double cost = sets->costs[first | part] + sets->costs[others ^ part];
        if (cost < least) {
            least = cost;
            best = first | part;
        }
    } while (part != 0);
    sets->costs[set] = node_cost(model, set_area(sets, set), least, sets->references[set]);
    sets->parts[set] = (uchar)best;
}

/// The dynamic programme: the smaller sets first, those of one size at the same time.
static void find_costs(CostModel model, global const SetOrder* order, SHARED Sets* sets) {
    for (uint size = 2; size <= TREELET_SIZE; ++size) {
        const uint end = order->begins[size + 1];
        for (uint i = order->begins[size] + LANE; i < end; i += LANES)
            find_cost(model, sets, order->sets[i]);
        SYNCHRONISE();
    }
}

// --- topology -----------------------------------------------------------------------------------

/// The part that a set becomes: its leaf, or what merge `made` - 1 makes, and then `made` is that.
static uint part_of(SHARED Sets* sets, uint set, uint* made) {
    const uint last_leaf = 31 - clz(set);
    if (set == 1U << last_leaf) return last_leaf;
    sets->made[--*made] = set;
    return TREELET_SIZE + *made;
}

/// The merges of the best topology, from the root down: the last first. Called by one lane.
static void divide_leaves(SHARED Treelet* treelet, SHARED Sets* sets) {
    uint made = MERGES - 1;
    sets->made[made] = ALL_LEAVES;
    for (uint merge = MERGES; merge-- > 0;) {
        const uint set = sets->made[merge], part = sets->parts[set];
        treelet->left[merge] = part_of(sets, part, &made);
        treelet->right[merge] = part_of(sets, set ^ part, &made);
    }
}

// --- kernels ------------------------------------------------------------------------------------

/// Costs of interior nodes, none below another, from those of all below them.
kernel void update_costs(global Box* boxes,         // of the tree, by node
                         global uint2* children,    // by interior node
                         global uint* references,   // by interior node: how many below it
                         uint first_leaf,           // number of the tree's first leaf
                         global const uint* nodes,  // interior nodes
                         uint first,                // of those to update, in `nodes`
                         uint end,                  // of those to update, in `nodes`
                         CostModel model, global double* costs) {  // by interior node
    const uint place = first + (uint)get_global_id(0);
    if (place >= end) return;
    const Tree tree = {boxes, children, references, first_leaf};
    const uint node = nodes[place];
    costs[node] = updated_cost(tree, costs, model, node);
}

/// Gives the treelets under some roots their best topology where that costs less. No root may be
/// below another.
kernel void optimise_treelets(global Box* boxes,         // of the tree, by node
                              global uint2* children,    // by interior node
                              global uint* references,   // by interior node: how many below it
                              uint first_leaf,           // number of the tree's first leaf
                              global const uint* roots,  // of treelets
                              uint first_root,           // place in `roots` of the first treelet
                              uint end_root,             // and behind the last
                              CostModel model, global const SetOrder* order,
                              global double* costs,       // by interior node
                              global double* savings,     // of area, by place in `roots`
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

    // What is below the root may have changed since its cost was found.
    const double root_cost = updated_cost(tree, costs, model, root);
    const double area = form_treelet(tree, root, &space->treelet);
    load_sets(tree, costs, model, &space->treelet, &space->sets);
    find_costs(model, order, &space->sets);
    if (!(space->sets.costs[ALL_LEAVES] < root_cost)) {
        if (LANE == 0) {
            costs[root] = root_cost;
            savings[place] = 0.0;
        }
        return;
    }
    if (LANE == 0) divide_leaves(&space->treelet, &space->sets);
    SYNCHRONISE();
    const double divided_area = measure(&space->treelet);
    replace_treelet(tree, &space->treelet);
    // A set's cost is that of its node: the same terms of the same parts.
    for (uint merge = LANE; merge < MERGES; merge += LANES)
        costs[made_node(&space->treelet, merge)] = space->sets.costs[space->sets.made[merge]];
    if (LANE == 0) savings[place] = area - divided_area;
}
