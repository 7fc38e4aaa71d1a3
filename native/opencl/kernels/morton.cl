// SPDX-License-Identifier: GPL-3.0-or-later
// Boxes of triangles and their Morton codes, as build/morton_order.cpp.

// --- codes --------------------------------------------------------------------------------------

/// MortonGrid of build/morton.h
typedef struct {
    float lower[3];
    double scale[3];  // cells to a unit of length
} MortonGrid;

/// Spreads the lowest 21 bits so that two zero bits follow each.
static ulong spread_by_three(ulong value) {
    value &= 0x1FFFFFUL;
    value = (value | value << 32) & 0x001F00000000FFFFUL;
    value = (value | value << 16) & 0x001F0000FF0000FFUL;
    value = (value | value << 8) & 0x100F00F00F00F00FUL;
    value = (value | value << 4) & 0x10C30C30C30C30C3UL;
    value = (value | value << 2) & 0x1249249249249249UL;
    return value;
}

static ulong cell_of(MortonGrid grid, Box box, int axis) {
    const double centre = 0.5 * ((double)box.lower[axis] + (double)box.upper[axis]);
    return (ulong)((centre - (double)grid.lower[axis]) * grid.scale[axis]);
}

// --- triangles ----------------------------------------------------------------------------------

static Box point_box(float3 point) {
    return (Box){{point.x, point.y, point.z}, {point.x, point.y, point.z}};
}

kernel void morton_codes(global const float* vertices,  // 3 each
                         global const uint* triangles,  // 3 each
                         uint count,                    // of triangles
                         MortonGrid grid,               // over the mesh
                         global Box* boxes,             // by triangle
                         global ulong* codes,           // by triangle: 60 bits
                         global uint* references)       // 0, 1, ...
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    const uint3 corners = vload3(i, triangles);
    Box box = point_box(vload3(corners.x, vertices));
    box = unite(box, point_box(vload3(corners.y, vertices)));
    box = unite(box, point_box(vload3(corners.z, vertices)));
    boxes[i] = box;
    codes[i] = spread_by_three(cell_of(grid, box, 0)) |
               spread_by_three(cell_of(grid, box, 1)) << 1 |
               spread_by_three(cell_of(grid, box, 2)) << 2;
    references[i] = i;
}

/// Writes the boxes of leaves in the order of their references.
kernel void place_leaf_boxes(global const Box* boxes,        // by triangle
                             global const uint* references,  // by leaf
                             uint count,                     // of leaves
                             uint first_leaf,                // node of the first
                             global Box* nodes)              // boxes by node
{
    const uint i = (uint)get_global_id(0);
    if (i < count) nodes[first_leaf + i] = boxes[references[i]];
}
