// SPDX-License-Identifier: GPL-3.0-or-later
// How traversal reads trees of compressed nodes (Ylitie, Karras, Laine 2017, section 3.1):
// CompressedNode and CompressedBvh of bvh/compressed_bvh.h. WIDTH is 8; LANES is 4, or 1.

typedef struct __attribute__((aligned(16))) {
    float origin[3];
    uchar exponent[3];  // of the steps, biased by 127
    uchar interior_mask;
    uint first_child;
    uint first_triangle;
    uchar meta[8];
    uchar planes[6][8];  // lower x, y, z, upper x, y, z
} Node;

typedef struct {
    __global const Node* nodes;
    __global const float* leaves;    // a leaf of n references from f on: 9 rows of n floats at 9 f
    __global const uint* triangles;  // by reference
} Tree;

/// A child that is still to be visited.
typedef struct {
    float urgency;  // the least is visited first
    uint child;     // node or first reference
    uint count;     // 0 for a node, else references of the leaf
} StackEntry;

// --- nodes --------------------------------------------------------------------------------------

/// The product is exact, so it may be fused.
inline float8 plane_row(__global const Node* node, uint row, float step, float origin) {
    return origin + convert_float8(vload8(0, node->planes[row])) * step;
}

inline float step_of(__global const Node* node, int axis) {
    return as_float((uint)node->exponent[axis] << 23);
}

inline uint enter_node(const Tree* tree, uint index, const PreparedRay* ray, float t_far,
                       bool any_hit, float8* urgency) {
    __global const Node* const node = &tree->nodes[index];
    const uint x = ray->slab[0].negative ? 3 : 0;
    const uint y = ray->slab[1].negative ? 3 : 0;
    const uint z = ray->slab[2].negative ? 3 : 0;
    const float step_x = step_of(node, 0), step_y = step_of(node, 1), step_z = step_of(node, 2);
    const float ox = node->origin[0], oy = node->origin[1], oz = node->origin[2];
    const uint entered = enter_boxes(
        ray, t_far, any_hit, plane_row(node, x, step_x, ox), plane_row(node, 3 - x, step_x, ox),
        plane_row(node, 1 + y, step_y, oy), plane_row(node, 4 - y, step_y, oy),
        plane_row(node, 2 + z, step_z, oz), plane_row(node, 5 - z, step_z, oz), urgency);
    return entered & mask_bits8(convert_int8(vload8(0, node->meta)) != 0);
}

inline StackEntry child_of(const Tree* tree, uint index, uint slot, float urgency) {
    __global const Node* const node = &tree->nodes[index];
    const uint meta = node->meta[slot];
    const bool leaf = (meta & 31U) < 24U;
    const uint before = node->interior_mask & ((1U << slot) - 1U);
    return (StackEntry){
        urgency, leaf ? node->first_triangle + (meta & 31U) : node->first_child + popcount(before),
        leaf ? popcount(meta >> 5) : 0};
}

/// Children that are there.
inline uint box_count(const Tree* tree, uint index) {
    uint boxes = 0;
    for (uint slot = 0; slot < 8; ++slot) boxes += tree->nodes[index].meta[slot] != 0;
    return boxes;
}

// --- leaves -------------------------------------------------------------------------------------

/// The triangles of a leaf; lanes behind the last hold numbers of other rows.
typedef struct {
    __global const float* rows;
    uint stride;
    __global const uint* triangles;
    uint used;
} Block;

/// The leaf's triangles from number `first` on.
inline Block block_of(const Tree* tree, const StackEntry* leaf, uint first) {
    return (Block){tree->leaves + (size_t)9 * leaf->child + first, leaf->count,
                   tree->triangles + leaf->child + first, min(leaf->count - first, (uint)LANES)};
}
