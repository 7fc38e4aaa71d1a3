// SPDX-License-Identifier: GPL-3.0-or-later
// Trees of pairs from binary trees and back (build/reinsertion_tree.cpp), and their order in
// memory. Every kernel has one work-item for a pair.

// --- from a binary tree -------------------------------------------------------------------------

/// Where the scene lies: lower corner 0 and longest side 1 after (x - origin) * scale, in double,
/// as scenes may be of any scale.
typedef struct {
    float origin[3];
    float unused;
    double scale;
} UnitScale;

static float to_unit(float coordinate, float origin, double scale) {
    return (float)(((double)coordinate - (double)origin) * scale);
}

static BoxPair repeated_unit_box(Box box, UnitScale unit) {
    float lower[3], negated_upper[3];
    for (int axis = 0; axis < 3; ++axis) {
        lower[axis] = to_unit(box.lower[axis], unit.origin[axis], unit.scale);
        negated_upper[axis] = -to_unit(box.upper[axis], unit.origin[axis], unit.scale);
    }
    return (BoxPair){
        (float4)(lower[0], lower[0], lower[1], lower[1]),
        (float4)(negated_upper[0], negated_upper[0], negated_upper[1], negated_upper[1]),
        (float4)(lower[2], lower[2], negated_upper[2], negated_upper[2])};
}

/// Pair 0 holds the root, pair i the children of interior node i - 1.
kernel void make_pairs(global const Box* boxes,       // by node of the binary tree
                       global const uint2* children,  // by interior node
                       uint count,                    // pairs, as many as leaves
                       UnitScale unit,                // the scene's
                       global SlotPair* pairs,        // all are written
                       global uint* parents)          // by pair
{
    const uint pair = get_global_id(0);
    if (pair >= count) return;
    const uint first_leaf = count - 1;
    const uint2 nodes = pair == 0 ? (uint2)(0, 0) : children[pair - 1];
    if (pair == 0) parents[0] = ROOT;
    for (uint side = 0; side < 2; ++side) {
        const uint node = of_side(nodes, side);
        const uint child = node >= first_leaf ? LEAF_FLAG | (node - first_leaf) : node + 1;
        set_box(&pairs[pair], side, repeated_unit_box(boxes[node], unit));
        if (pair == 0 && side == 1)
            ((global uint*)&pairs[0].child)[1] = child;  // never looked at: the root has no sibling
        else
            set_child(pairs, parents, 2 * pair + side, child);
    }
}

// --- topology -----------------------------------------------------------------------------------

/// Keeps what is a child of what.
kernel void save_topology(global const SlotPair* pairs,  // the tree
                          uint count,                    // pairs
                          global uint2* topology)        // SlotPair::child by pair
{
    const uint pair = get_global_id(0);
    if (pair < count) topology[pair] = pairs[pair].child;
}

/// The tree with that topology; its boxes are left as they are.
kernel void restore_topology(global const uint2* topology,  // by pair
                             uint count,                    // pairs
                             global SlotPair* pairs,        // the tree
                             global uint* parents)          // by pair
{
    const uint pair = get_global_id(0);
    if (pair >= count) return;
    const uint2 child = topology[pair];
    pairs[pair].child = child;
    if (!is_leaf(child.x)) parents[child.x] = 2 * pair;
    if (!is_leaf(child.y) && pair > 0) parents[child.y] = 2 * pair + 1;
}

// --- order in memory ----------------------------------------------------------------------------

/// Where a pair comes in depth-first order: its number among pairs, from 1 on, and that of the
/// first leaf below it among leaves.
typedef uint2 Place;

static uint new_child(global const Place* places, uint child) {
    return is_leaf(child) ? child : places[child].x;
}

/// Copies all pairs to their places.
kernel void lay_out_pairs(global const SlotPair* pairs,  // the tree
                          global const uint* parents,    // by pair
                          global const Place* places,    // by pair
                          uint count,                    // pairs
                          global SlotPair* new_pairs,    // the tree in depth-first order
                          global uint* new_parents)      // by pair
{
    const uint pair = get_global_id(0);
    if (pair >= count) return;
    SlotPair moved = pairs[pair];
    moved.child.x = new_child(places, moved.child.x);
    if (pair == 0) {
        new_pairs[0] = moved;
        new_parents[0] = ROOT;
        return;
    }
    moved.child.y = new_child(places, moved.child.y);
    const uint place = places[pair].x, parent = parents[pair];
    new_pairs[place] = moved;
    new_parents[place] = parent == ROOT ? ROOT : 2 * places[parent >> 1].x + (parent & 1);
}

// --- to a binary tree ---------------------------------------------------------------------------

/// Writes a leaf and returns its number.
static uint write_leaf(global const Box* base_boxes, global const uint* base_references, uint leaf,
                       uint place, uint first_leaf, global Box* boxes, global uint* references) {
    boxes[first_leaf + place] = base_boxes[first_leaf + leaf];
    references[place] = base_references[leaf];
    return first_leaf + place;
}

/// Writes each pair as an interior node with the leaves that are its children, all numbered
/// depth-first as by bvh/depth_first.h.
kernel void write_nodes(global const SlotPair* pairs,        // the tree
                        global const Place* places,          // by pair
                        global const uint* sizes,            // pairs in the subtree, by pair
                        global const Box* pair_boxes,        // the node's own box, by pair
                        uint count,                          // pairs
                        global const Box* base_boxes,        // of the base
                        global const uint* base_references,  // of the base
                        global Box* boxes,                   // by node
                        global uint2* children,              // by interior node
                        global uint* references)             // by leaf
{
    const uint pair = get_global_id(0);
    if (pair == 0 || pair >= count) return;
    const uint first_leaf = count - 1;
    const uint2 child = pairs[pair].child;
    const Place place = places[pair];
    const uint left_leaves = is_leaf(child.x) ? 1 : sizes[child.x] + 1;
    uint2 nodes;
    nodes.x = is_leaf(child.x) ? write_leaf(base_boxes, base_references, child.x & ~LEAF_FLAG,
                                            place.y, first_leaf, boxes, references)
                               : places[child.x].x - 1;
    nodes.y = is_leaf(child.y) ? write_leaf(base_boxes, base_references, child.y & ~LEAF_FLAG,
                                            place.y + left_leaves, first_leaf, boxes, references)
                               : places[child.y].x - 1;
    boxes[place.x - 1] = pair_boxes[pair];
    children[place.x - 1] = nodes;
}
