// SPDX-License-Identifier: GPL-3.0-or-later
// The levels above the cells of a coarse grid, divided by the binned surface area heuristic, as
// build/hlbvh.cpp (Pantaleoni and Luebke 2010), level by level as by Garanzha et al. 2011.
// Needs range_boxes.cl and lbvh.cl before it, and option SMALL: clusters of a task at most that
// one work-item divides by itself.

// --- types --------------------------------------------------------------------------------------

/// The references of one cell.
typedef struct {
    uint size;
    uchar cell[4];  // by axis; the last is not used
    Box box;
} Cluster;

/// A node above the clusters that is to be divided: where its clusters stand in their order, its
/// number, and the number of its first leaf. Each task makes those of its children.
typedef struct {
    uint begin, count;
    uint node, leaf;
    uint references;
} Task;

/// Where a cluster's subtree goes: its root's number if it is interior, and its first leaf.
typedef struct {
    uint node, leaf;
} Place;

/// What the tasks of all levels write to.
typedef struct {
    global uint* order;            // of clusters, for the next level
    global Task* small;            // tasks of at most SMALL clusters
    global Task* large;            // those of more
    volatile global uint* counts;  // of small, of large
    global Place* places;          // by cluster
    global uint2* children;        // by node: left, right
    uint first_leaf;               // node of the first leaf
} Output;

/// Clusters in cells below `cell` on `axis` go left.
typedef struct {
    double cost;
    int axis, cell;
} Plane;

// --- clusters: runs of codes with the same leading bits -----------------------------------------

kernel void mark_clusters(global const ulong* codes,  // ascending
                          uint count,                 // of codes
                          uint shift,                 // that leaves the leading bits
                          global uint* heads)         // count + 1: 1 where a cluster begins
{
    const uint i = (uint)get_global_id(0);
    if (i > count) return;
    heads[i] = i == 0 || i == count || codes[i] >> shift != codes[i - 1] >> shift;
}

kernel void list_clusters(global const uint* before,  // heads, scanned
                          uint count,                 // of codes
                          global uint* firsts)        // by cluster, and `count` behind the last
{
    const uint i = (uint)get_global_id(0);
    if (i > count) return;
    if (i == count || before[i + 1] != before[i]) firsts[before[i]] = i;
}

kernel void make_clusters(global const uint* firsts,  // first place of each, and behind the last
                          uint count,                 // of clusters
                          global const ulong* codes,  // by place
                          uint code_bits,             // of a code
                          uint bits,                  // that a cluster's codes share
                          global const Box* boxes,    // by place
                          uint leaf_count,            // places
                          global const Box* levels,   // above `boxes`
                          global Cluster* clusters,   // what is made
                          global uint* order)         // 0, 1, ...
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    Cluster cluster;
    const uint first = firsts[i];
    cluster.size = firsts[i + 1] - first;
    cluster.box = range_box(boxes, levels, leaf_count, first, first + cluster.size - 1);
    uint cell[3] = {0, 0, 0};
    for (uint bit = 0; bit < bits; ++bit)
        cell[2 - bit % 3] =
            cell[2 - bit % 3] << 1 | ((uint)(codes[first] >> (code_bits - 1 - bit)) & 1);
    for (int axis = 0; axis < 3; ++axis) cluster.cell[axis] = (uchar)cell[axis];
    cluster.cell[3] = 0;
    clusters[i] = cluster;
    order[i] = i;
}

// --- tasks --------------------------------------------------------------------------------------

/// One side of a division: a cluster with its place, or a task. In which order tasks of one level
/// stand does not show in the tree.
static void put_side(const Output* output, Task side) {
    if (side.count == 1) {
        output->places[output->order[side.begin]] = (Place){side.node, side.leaf};
        return;
    }
    if (side.count <= SMALL)
        output->small[atomic_inc(&output->counts[0])] = side;
    else
        output->large[atomic_inc(&output->counts[1])] = side;
}

/// Ends a task whose clusters are divided: the first `left_count` go left.
static void end_task(const Output* output, Task task, uint left_count, uint left_references) {
    const uint right_references = task.references - left_references;
    const Task left = {task.begin, left_count, task.node + 1, task.leaf, left_references};
    const Task right = {task.begin + left_count, task.count - left_count,
                        task.node + left_references, task.leaf + left_references, right_references};
    output->children[task.node] =
        (uint2)(left_references == 1 ? output->first_leaf + left.leaf : left.node,
                right_references == 1 ? output->first_leaf + right.leaf : right.node);
    put_side(output, left);
    put_side(output, right);
}

// --- small tasks: one work-item each ------------------------------------------------------------

/// Sorts the clusters of a task by cell. Where many stand in one cell their order does not matter.
static void sort_by_cell(global const Cluster* clusters, uint* own, uint count, int axis) {
    for (uint i = 1; i < count; ++i) {
        const uint cluster = own[i];
        const uchar cell = clusters[cluster].cell[axis];
        uint place = i;
        for (; place > 0 && clusters[own[place - 1]].cell[axis] > cell; --place)
            own[place] = own[place - 1];
        own[place] = cluster;
    }
}

/// The plane of least cost behind a cell that is not empty. Planes behind an empty one cost what
/// the one before them does, and the first of equals is taken.
static void find_small_plane(global const Cluster* clusters, const uint* own, uint count, int axis,
                             Plane* best) {
    double right_costs[SMALL];
    Box box = empty_box();
    for (uint i = count - 1; i > 0; --i) {
        box = unite(box, clusters[own[i]].box);
        right_costs[i] = half_area(box) * (double)(count - i);
    }
    box = empty_box();
    for (uint i = 1; i < count; ++i) {
        box = unite(box, clusters[own[i - 1]].box);
        const int cell = clusters[own[i - 1]].cell[axis];
        if (clusters[own[i]].cell[axis] == cell) continue;
        const double cost = half_area(box) * (double)i + right_costs[i];
        if (cost < best->cost) *best = (Plane){cost, axis, cell + 1};
    }
}

kernel void split_small(global Task* small,              // tasks of all levels
                        uint first_task,                 // of this level
                        uint task_count,                 // of this level
                        global Task* large,              // see Output
                        volatile global uint* counts,    // see Output
                        global const Cluster* clusters,  // what is divided
                        global const uint* order,        // of clusters
                        global uint* next_order,         // for the next level
                        global Place* places,            // see Output
                        global uint2* children,          // see Output
                        uint first_leaf)                 // see Output
{
    if (get_global_id(0) >= task_count) return;
    const Task task = small[first_task + get_global_id(0)];
    uint own[SMALL];
    for (uint i = 0; i < task.count; ++i) own[i] = order[task.begin + i];
    Plane plane = {INFINITY, 0, 0};
    for (int axis = 0; axis < 3; ++axis) {
        sort_by_cell(clusters, own, task.count, axis);
        find_small_plane(clusters, own, task.count, axis, &plane);
    }

    uint left_count = 0, left_references = 0, right_begin = task.begin + task.count;
    for (uint i = 0; i < task.count; ++i) {
        if (clusters[own[i]].cell[plane.axis] < plane.cell) {
            next_order[task.begin + left_count++] = own[i];
            left_references += clusters[own[i]].size;
        } else {
            next_order[--right_begin] = own[i];
        }
    }
    const Output output = {next_order, small, large, counts, places, children, first_leaf};
    end_task(&output, task, left_count, left_references);
}

// --- large tasks: one work-group each -----------------------------------------------------------

/// Maps floats to integers in the same order, for atomics; its own inverse.
static int ordered(int bits) {
    return bits >= 0 ? bits : bits ^ 0x7FFFFFFF;
}

// Where a work-group is one work-item there is nothing to guard.
#ifdef ALONE
#define LOWER(target, value) (*(target) = min(*(target), (value)))
#define RAISE(target, value) (*(target) = max(*(target), (value)))
#define ADD(target, value) (*(target) += (value), *(target) - (value))
#else
#define LOWER(target, value) atomic_min(target, value)
#define RAISE(target, value) atomic_max(target, value)
#define ADD(target, value) atomic_add(target, value)
#endif

/// Of the clusters in one layer of cells: the union of their boxes, ordered, and how many.
typedef struct {
    int lower[3], upper[3];
    uint clusters;
} Bin;

static void grow_bins(volatile local Bin* bins, uint cells, Cluster cluster) {
    for (int axis = 0; axis < 3; ++axis) {
        volatile local Bin* bin = &bins[axis * cells + cluster.cell[axis]];
        for (int k = 0; k < 3; ++k) {
            LOWER(&bin->lower[k], ordered(as_int(cluster.box.lower[k])));
            RAISE(&bin->upper[k], ordered(as_int(cluster.box.upper[k])));
        }
        ADD(&bin->clusters, 1U);
    }
}

static Box bin_box(volatile local Bin* bin) {
    Box box = empty_box();
    if (bin->clusters == 0) return box;
    for (int k = 0; k < 3; ++k) {
        box.lower[k] = as_float(ordered(bin->lower[k]));
        box.upper[k] = as_float(ordered(bin->upper[k]));
    }
    return box;
}

/// The first plane of least cost on one axis, with a cluster on each side of it.
static Plane find_plane(volatile local Bin* bins, local double* right_costs, uint cells,
                        uint clusters, int axis) {
    Box box = empty_box();
    uint count = 0;
    for (uint cell = cells - 1; cell > 0; --cell) {
        box = unite(box, bin_box(&bins[cell]));
        count += bins[cell].clusters;
        right_costs[cell] = half_area(box) * (double)count;
    }
    Plane best = {INFINITY, axis, 0};
    box = empty_box();
    count = 0;
    for (uint cell = 1; cell < cells; ++cell) {
        box = unite(box, bin_box(&bins[cell - 1]));
        count += bins[cell - 1].clusters;
        const double cost = half_area(box) * (double)count + right_costs[cell];
        if (count > 0 && count < clusters && cost < best.cost)
            best = (Plane){cost, axis, (int)cell};
    }
    return best;
}

kernel void split_large(global Task* large,              // tasks of all levels
                        uint first_task,                 // of this level; one to a work-group
                        global Task* small,              // see Output
                        volatile global uint* counts,    // see Output
                        global const Cluster* clusters,  // what is divided
                        global const uint* order,        // of clusters
                        global uint* next_order,         // for the next level
                        global Place* places,            // see Output
                        global uint2* children,          // see Output
                        uint first_leaf,                 // see Output
                        uint cells,                      // of the grid, per axis
                        volatile local Bin* bins,        // 3 times cells
                        local double* right_costs,       // 3 times cells
                        local Plane* planes,             // 3
                        volatile local uint* sums)       // 3
{
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    const Task task = large[first_task + get_group_id(0)];
    for (uint i = item; i < 3 * cells; i += size) {
        for (int k = 0; k < 3; ++k) {
            bins[i].lower[k] = INT_MAX;
            bins[i].upper[k] = INT_MIN;
        }
        bins[i].clusters = 0;
    }
    if (item < 1)
        for (int k = 0; k < 3; ++k) sums[k] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);

    for (uint i = item; i < task.count; i += size)
        grow_bins(bins, cells, clusters[order[task.begin + i]]);
    barrier(CLK_LOCAL_MEM_FENCE);

    for (uint axis = item; axis < 3; axis += size)
        planes[axis] = find_plane(bins + axis * cells, right_costs + axis * cells, cells,
                                  task.count, (int)axis);
    barrier(CLK_LOCAL_MEM_FENCE);

    // Left clusters fill the range from the front, right ones from the back.
    Plane plane = planes[0];
    for (int axis = 1; axis < 3; ++axis)
        if (planes[axis].cost < plane.cost) plane = planes[axis];
    for (uint i = item; i < task.count; i += size) {
        const uint cluster = order[task.begin + i];
        if (clusters[cluster].cell[plane.axis] < plane.cell) {
            next_order[task.begin + ADD(&sums[0], 1U)] = cluster;
            ADD(&sums[1], clusters[cluster].size);
        } else {
            next_order[task.begin + task.count - 1 - ADD(&sums[2], 1U)] = cluster;
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    if (item == 0) {
        const Output output = {next_order, small, large, counts, places, children, first_leaf};
        end_task(&output, task, sums[0], sums[1]);
    }
}

// --- below the clusters: the subtrees of the radix tree -----------------------------------------

kernel void place_references(global const uint* before,      // heads of clusters, scanned
                             global const uint* firsts,      // first place of each cluster
                             global const Place* places,     // of clusters
                             global const uint* references,  // by place in Morton order
                             uint count,                     // of references
                             global uint* placed)            // by leaf
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    const uint cluster = before[i + 1] - 1;
    placed[places[cluster].leaf + i - firsts[cluster]] = references[i];
}

/// Finds the node of the radix tree that each cluster of more than one reference is.
kernel void find_roots(global const RadixNode* nodes,  // of the radix tree
                       global const uint* numbers,     // by node
                       uint count,                     // of nodes
                       global const uint* before,      // heads of clusters, scanned
                       global const uint* firsts,      // first place of each cluster
                       global uint* roots)             // by cluster: number of its node
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    const uint first = min(i, nodes[i].other), last = max(i, nodes[i].other);
    const uint cluster = before[first + 1] - 1;
    if (firsts[cluster] == first && firsts[cluster + 1] == last + 1) roots[cluster] = numbers[i];
}

kernel void cluster_nodes(global const RadixNode* nodes,  // of the radix tree
                          global const uint* numbers,     // by node
                          uint leaf_count,                // one more than nodes
                          global const uint* before,      // heads of clusters, scanned
                          global const uint* firsts,      // first place of each cluster
                          global const uint* roots,       // by cluster
                          global const Place* places,     // by cluster
                          global const Box* levels,       // above the leaves' boxes
                          global uint2* children,         // by number: left, right
                          global Box* boxes)              // by number; those of leaves are there
{
    const uint i = (uint)get_global_id(0);
    if (i >= leaf_count - 1) return;
    const RadixNode node = nodes[i];
    const uint first = min(i, node.other), last = max(i, node.other);
    const uint cluster = before[first + 1] - 1;
    if (last >= firsts[cluster + 1]) return;
    const Place place = places[cluster];
    write_node(place.node + numbers[i] - roots[cluster], first, last, node.split,
               place.leaf - firsts[cluster], leaf_count, levels, children, boxes);
}

kernel void top_boxes(global const Task* tasks,  // of all levels
                      uint count,                // of tasks
                      uint leaf_count,           // of the tree
                      global const Box* levels,  // above the leaves' boxes
                      global Box* boxes)         // by node; those of leaves are there
{
    if (get_global_id(0) >= count) return;
    const Task task = tasks[get_global_id(0)];
    boxes[task.node] = range_box(boxes + leaf_count - 1, levels, leaf_count, task.leaf,
                                 task.leaf + task.references - 1);
}
