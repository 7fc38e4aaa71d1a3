// SPDX-License-Identifier: GPL-3.0-or-later
// Fills the nodes and triangle blocks of a breadth-first layout (paper section 3), as
// bvh/layout.cpp. Behind level_order.cl.

// --- kernels ------------------------------------------------------------------------------------

/// Fills nodes: WIDTH planes of each of lower x, upper x, lower y, ..., then the children's
/// numbers, then their numbers of references (bvh/wide_node.h).
kernel void fill_nodes(global const Box* boxes,         // of the binary tree's nodes
                       global const uint2* plans,       // of its interior nodes
                       uint first_leaf,                 // number of these
                       uint count,                      // wide nodes
                       uint start,                      // of these, that of the first work-item
                       global const uint* opened,       // children, WIDTH for each wide node
                       global const uint* first_child,  // by wide node
                       global const uint* blocks,       // first block of its leaves, by wide node
                       global uint* nodes)              // out: 8 WIDTH for each wide node
{
    const uint wide = start + (uint)get_global_id(0);
    if (wide >= count) return;
    const Planned tree = {0, plans, boxes, first_leaf};
    global uint* const node = nodes + (size_t)wide * (8 * WIDTH);
    uint interior = first_child[wide], block = blocks[wide];
    for (uint c = 0; c < WIDTH; ++c) {
        const uint child = opened[(size_t)wide * WIDTH + c];
        Box box = empty_box();
        uint number = 0, size = 0;
        if (!is_missing(child)) {
            box = boxes[binary_node(child)];
            if (is_leaf(child)) {
                size = size_below(tree, binary_node(child));
                number = block;
                block += blocks_of(size);
            } else {
                number = interior++;
            }
        }
        for (uint axis = 0; axis < 3; ++axis) {
            node[2 * axis * WIDTH + c] = as_uint(box.lower[axis]);
            node[(2 * axis + 1) * WIDTH + c] = as_uint(box.upper[axis]);
        }
        node[6 * WIDTH + c] = number;
        node[7 * WIDTH + c] = size;
    }
}

/// Fills blocks, a lane to a work-item: LANES coordinates of each of corner a x, a y, a z, b x,
/// ..., then the triangles (bvh/wide_bvh.h).
kernel void fill_blocks(global const float* vertices,  // of the mesh, 3 each
                        global const uint* triangles,  // of the mesh, 3 vertices each
                        global const uint* lanes,      // of list_references
                        ulong lane_count,              //
                        ulong start,                   // lane of the first work-item
                        global uint* blocks)           // out: 10 LANES for each block
{
    const ulong i = start + get_global_id(0);
    if (i >= lane_count) return;
    const bool unused = (lanes[i] & 0x80000000U) != 0U;
    const uint triangle = lanes[i] & 0x7FFFFFFFU;
    global uint* const out = blocks + i / LANES * (10 * LANES) + i % LANES;
    for (uint corner = 0; corner < 3; ++corner) {
        const size_t vertex = triangles[3 * (size_t)triangle + corner];
        for (uint axis = 0; axis < 3; ++axis)
            out[(3 * corner + axis) * LANES] = as_uint(vertices[3 * vertex + axis]);
    }
    out[9 * LANES] = unused ? NO_TRIANGLE : triangle;
}
