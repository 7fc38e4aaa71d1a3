// SPDX-License-Identifier: GPL-3.0-or-later
// How traversal reads trees of full nodes: WideNode and TriangleBlock of bvh/wide_node.h and
// bvh/wide_bvh.h. WIDTH: children of a node; BLOCK: triangles of a block.

typedef struct __attribute__((aligned(32))) {
    float planes[6][WIDTH];  // lower x, upper x, lower y, upper y, lower z, upper z
    uint child[WIDTH];       // interior child: node; leaf: its first triangle block
    uint count[WIDTH];       // interior child: 0; leaf: number of references
} Node;

typedef struct {
    __global const Node* nodes;
    __global const float* leaves;    // blocks: 9 rows of BLOCK coordinates, then BLOCK indices
    __global const uint* triangles;  // not used
} Tree;

#define BLOCK_WORDS (10 * BLOCK)

/// A child that is still to be visited.
typedef struct {
    float urgency;  // the least is visited first
    uint child;     // node or first block
    uint count;     // 0 for a node, else references of the leaf
} StackEntry;

// --- nodes --------------------------------------------------------------------------------------

inline FLOATS plane_row(__global const Node* node, uint row) {
    return *(__global const FLOATS*)node->planes[row];
}

inline uint enter_node(const Tree* tree, uint index, const PreparedRay* ray, float t_far,
                       bool any_hit, FLOATS* urgency) {
    __global const Node* const node = &tree->nodes[index];
    const uint x = ray->slab[0].negative, y = ray->slab[1].negative, z = ray->slab[2].negative;
    return enter_boxes(ray, t_far, any_hit, plane_row(node, x), plane_row(node, 1 - x),
                       plane_row(node, 2 + y), plane_row(node, 3 - y), plane_row(node, 4 + z),
                       plane_row(node, 5 - z), urgency);
}

inline StackEntry child_of(const Tree* tree, uint index, uint i, float urgency) {
    __global const Node* const node = &tree->nodes[index];
    return (StackEntry){urgency, node->child[i], node->count[i]};
}

/// Children that are there.
inline uint box_count(const Tree* tree, uint index) {
    __global const Node* const node = &tree->nodes[index];
    uint boxes = 0;
    for (uint i = 0; i < WIDTH; ++i) boxes += node->planes[0][i] <= node->planes[1][i];
    return boxes;
}

// --- leaves -------------------------------------------------------------------------------------

/// Up to LANES triangles of a leaf.
typedef struct {
    __global const float* rows;
    uint stride;
    __global const uint* triangles;
    uint used;
} Block;

/// The leaf's triangles from number `first` on, a multiple of LANES, which divides BLOCK.
inline Block block_of(const Tree* tree, const StackEntry* leaf, uint first) {
    __global const float* const rows =
        tree->leaves + (size_t)(leaf->child + first / BLOCK) * BLOCK_WORDS;
    const uint lane = first % BLOCK;
    return (Block){rows + lane, BLOCK, (__global const uint*)(rows + 9 * BLOCK) + lane,
                   min(leaf->count - first, (uint)LANES)};
}
