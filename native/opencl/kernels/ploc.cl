// SPDX-License-Identifier: GPL-3.0-or-later
// Parallel locally-ordered clustering (Meister and Bittner 2018a), as build/ploc.cpp. A row holds
// the roots of the subtrees built so far, in Morton order: their boxes scaled to about the size of
// the unit cube, one array per face with `stride` floats in each, and their nodes.

#define NO_PARTNER 0xFFFFFFFFU

// --- rows ---------------------------------------------------------------------------------------

static Box row_box(global const float* row, uint stride, uint i) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        box.lower[axis] = row[(size_t)axis * stride + i];
        box.upper[axis] = row[(size_t)(axis + 3) * stride + i];
    }
    return box;
}

static void set_row_box(global float* row, uint stride, uint i, Box box) {
    for (int axis = 0; axis < 3; ++axis) {
        row[(size_t)axis * stride + i] = box.lower[axis];
        row[(size_t)(axis + 3) * stride + i] = box.upper[axis];
    }
}

/// UnitScale of build/ploc.cpp.
static float scaled(float coordinate, double factor) {
    return (float)clamp((double)coordinate * factor, -0x1p30, 0x1p30);
}

kernel void first_row(global const Box* leaves,  // boxes in Morton order
                      uint first_leaf,           // node of the first
                      uint count,                // of leaves
                      double factor,             // of the unit scale
                      uint stride,               // of `row`
                      global float* row,         // boxes
                      global uint* nodes)        // by place in the row
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    Box box = leaves[first_leaf + i];
    for (int axis = 0; axis < 3; ++axis) {
        box.lower[axis] = scaled(box.lower[axis], factor);
        box.upper[axis] = scaled(box.upper[axis], factor);
    }
    set_row_box(row, stride, i, box);
    nodes[i] = first_leaf + i;
}

// --- nearest neighbours -------------------------------------------------------------------------

/// Half the area of a box; in float, by the operations of build/nearest_cluster.cpp.
static float half_extent_area(float x, float y, float z) {
    return x * y + z * (x + y);
}

static float larger(float a, float b) {
    return a > b ? a : b;
}

static float smaller(float a, float b) {
    return a < b ? a : b;
}

/// Writes the cluster within `radius` places whose union with each is smallest, the first of
/// equals.
kernel void find_nearest(global const float* row,  // boxes
                         uint stride,              // of `row`
                         uint count,               // clusters in the row, at least 2
                         uint begin,               // the first of this launch
                         uint end,                 // behind the last of it
                         uint radius,              // in places
                         global uint* nearest,     // by place in the row
                         local float* tile)        // 6 times group size + 2 radius
{
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    const uint width = size + 2 * radius;

    // Copy the boxes in reach. Those beyond the row's ends are endless, so that no area is more.
    const long first = (long)begin + (long)(get_group_id(0) * size) - (long)radius;
    for (uint k = item; k < width; k += size) {
        const long i = first + k;
        const bool there = i >= 0 && i < (long)count;
        for (int plane = 0; plane < 6; ++plane)
            tile[plane * width + k] = there       ? row[(size_t)plane * stride + i]
                                      : plane < 3 ? -INFINITY
                                                  : INFINITY;
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    local const float* lower_x = tile + item;
    local const float* lower_y = lower_x + width;
    local const float* lower_z = lower_y + width;
    local const float* upper_x = lower_z + width;
    local const float* upper_y = upper_x + width;
    local const float* upper_z = upper_y + width;
    const float own_lower_x = lower_x[radius], own_upper_x = upper_x[radius];
    const float own_lower_y = lower_y[radius], own_upper_y = upper_y[radius];
    const float own_lower_z = lower_z[radius], own_upper_z = upper_z[radius];
    float least = INFINITY;
    uint best = 0;
    for (uint k = 0; k <= 2 * radius; ++k) {
        const float area =
            half_extent_area(larger(own_upper_x, upper_x[k]) - smaller(own_lower_x, lower_x[k]),
                             larger(own_upper_y, upper_y[k]) - smaller(own_lower_y, lower_y[k]),
                             larger(own_upper_z, upper_z[k]) - smaller(own_lower_z, lower_z[k]));
        const bool is_less = area < least && k != radius;
        best = is_less ? k : best;
        least = is_less ? area : least;
    }
    const uint i = begin + (uint)get_global_id(0);
    if (i < end) nearest[i] = i + best - radius;
}

// --- nearest neighbours by the vector units of a CPU --------------------------------------------

#define LANES 16
typedef float16 Values;
typedef int16 Indices;

/// The least areas so far, by lane, and the first candidate with it less the number of the lane.
typedef struct {
    Values least;
    Indices nearest;
} Search;

/// Looks at the candidates from..to - 1; reads up to LANES floats further.
static void search_places(Search* search, global const float* row, uint stride, const float* own,
                          int from, int to) {
    const Indices lanes = (Indices)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (int j = from; j < to; j += LANES) {
        Values extents[3];
        for (int axis = 0; axis < 3; ++axis) {
            const Values lower = vload16(0, row + (size_t)axis * stride + j);
            const Values upper = vload16(0, row + (size_t)(axis + 3) * stride + j);
            extents[axis] = (own[axis + 3] > upper ? own[axis + 3] : upper) -
                            (own[axis] < lower ? own[axis] : lower);
        }
        const Values areas = extents[0] * extents[1] + extents[2] * (extents[0] + extents[1]);
        const Indices is_less = areas < search->least && lanes < to - j;
        search->least = is_less ? areas : search->least;
        search->nearest = is_less ? (Indices)j : search->nearest;
    }
}

/// As find_nearest, one cluster's candidates side by side. Rows are padded by LANES floats.
kernel void find_nearest_by_lanes(global const float* row,  // boxes
                                  uint stride,              // of `row`
                                  uint count,               // clusters in the row, at least 2
                                  uint begin,               // the first of this launch
                                  uint end,                 // behind the last of it
                                  uint radius,              // in places
                                  global uint* nearest)     // by place in the row
{
    const uint i = begin + (uint)get_global_id(0);
    if (i >= end) return;
    float own[6];
    for (int plane = 0; plane < 6; ++plane) own[plane] = row[(size_t)plane * stride + i];
    Search search = {INFINITY, 0};
    search_places(&search, row, stride, own, (int)(i - min(i, radius)), (int)i);
    search_places(&search, row, stride, own, (int)i + 1, (int)min(i + radius, count - 1) + 1);

    // Choose between the lanes.
    float least[LANES];
    int candidates[LANES];
    vstore16(search.least, 0, least);
    vstore16(search.nearest, 0, candidates);
    int best = 0;
    for (int lane = 1; lane < LANES; ++lane) {
        candidates[lane] += lane;
        if (least[lane] < least[best] ||
            (least[lane] == least[best] && candidates[lane] < candidates[best]))
            best = lane;
    }
    nearest[i] = (uint)candidates[best];
}

// --- merging ------------------------------------------------------------------------------------

static bool is_mutual(global const uint* nearest, uint i) {
    return nearest[nearest[i]] == i;
}

/// The cluster that each merges with: its nearest, if that is mutual; in a stalled row neighbours
/// merge that are left over. build/ploc.cpp says why.
kernel void find_partners(global const uint* nearest,  // by place in the row
                          uint count,                  // clusters in the row
                          uint stalled,                // whether the row is
                          global uint* partners,       // by place; NO_PARTNER for none
                          global uint* goes)           // 1 for the second of a pair, else 0
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    uint partner = NO_PARTNER;
    const uint neighbour = i ^ 1;
    if (is_mutual(nearest, i))
        partner = nearest[i];
    else if (stalled && neighbour < count && !is_mutual(nearest, neighbour))
        partner = neighbour;
    partners[i] = partner;
    goes[i] = partner < i;
}

/// Merges pairs and closes the gaps. The union takes the place of the pair's first, and the rank
/// of its second among those that go gives the new node its number.
kernel void merge_clusters(global const uint* partners,  // by place
                           global const uint* gone,      // by place: how many go before
                           uint count,                   // clusters in the row
                           uint next_count,              // clusters in the next
                           uint stride,                  // of both rows
                           global const float* row,      // boxes
                           global const uint* nodes,     // by place
                           global float* next_row,       // boxes
                           global uint* next_nodes,      // by place
                           global Box* boxes,            // by node, not scaled
                           global uint2* children)       // by interior node
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) return;
    const uint partner = partners[i], place = i - gone[i];
    if (partner < i) return;
    Box box = row_box(row, stride, i);
    uint node = nodes[i];
    if (partner != NO_PARTNER) {
        const uint left = node, right = nodes[partner];
        node = next_count - 1 + gone[partner];
        children[node] = (uint2)(left, right);
        boxes[node] = unite(boxes[left], boxes[right]);
        box = unite(box, row_box(row, stride, partner));
    }
    next_nodes[place] = node;
    set_row_box(next_row, stride, place, box);
}
