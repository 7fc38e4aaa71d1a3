// SPDX-License-Identifier: GPL-3.0-or-later
// Compressed 8-wide nodes (Ylitie, Karras, Laine 2017, section 3), as bvh/octant_slots.cpp,
// bvh/quantise.cpp and bvh/compressed_layout.cpp, bit for bit. Behind level_order.cl.

/// As glm::min and glm::max, to the sign of a zero.
static float lesser(float a, float b) {
    return b < a ? b : a;
}
static float greater(float a, float b) {
    return a < b ? b : a;
}

// --- slots --------------------------------------------------------------------------------------
// Children get their slots one after the other, by the shortest path of changes that lets the new
// one in (Kuhn 1955; in this form Jonker, Volgenant 1987).

#define NOBODY 8U
#define ENTRY 8U  // not a slot: where a new child waits

typedef struct {
    double offset[8][3];  // from the node's centre to the child's, doubled
    double child_price[8], slot_price[9], shortest[9];
    uint child_in[9], before[9];
    uint reached;  // bit i: slot i
} Assignment;

static double slot_cost(const Assignment* assignment, uint child, uint slot) {
    const double x = assignment->offset[child][0];
    const double y = assignment->offset[child][1];
    const double z = assignment->offset[child][2];
    return (slot & 4U ? -x : x) + (slot & 2U ? -y : y) + (slot & 1U ? -z : z);
}

/// The nearest slot that no path has reached, one step of Dijkstra's algorithm behind `last`.
static uint reach_next(Assignment* assignment, uint last) {
    assignment->reached |= 1U << last;
    const uint child = assignment->child_in[last];
    uint nearest = ENTRY;
    double distance = INFINITY;
    for (uint slot = 0; slot < 8; ++slot) {
        if (assignment->reached >> slot & 1U) continue;
        const double reduced = slot_cost(assignment, child, slot) - assignment->child_price[child] -
                               assignment->slot_price[slot];
        if (reduced < assignment->shortest[slot]) {
            assignment->shortest[slot] = reduced;
            assignment->before[slot] = last;
        }
        if (assignment->shortest[slot] < distance) {
            distance = assignment->shortest[slot];
            nearest = slot;
        }
    }
    for (uint slot = 0; slot <= ENTRY; ++slot) {
        if (assignment->reached >> slot & 1U) {
            assignment->child_price[assignment->child_in[slot]] += distance;
            assignment->slot_price[slot] -= distance;
        } else {
            assignment->shortest[slot] -= distance;
        }
    }
    return nearest;
}

static void add_child(Assignment* assignment, uint child) {
    assignment->child_in[ENTRY] = child;
    uint last = ENTRY;
    for (uint slot = 0; slot <= ENTRY; ++slot) assignment->shortest[slot] = INFINITY;
    assignment->reached = 0;
    do last = reach_next(assignment, last);
    while (assignment->child_in[last] != NOBODY);
    for (; last != ENTRY; last = assignment->before[last])
        assignment->child_in[last] = assignment->child_in[assignment->before[last]];
}

/// Moves the children, which stand from left to right, into their slots.
void arrange(global const Box* boxes, uint* opened) {
    Assignment assignment;
    Box all = empty_box();
    uint count = 0;
    for (; count < 8 && !is_missing(opened[count]); ++count) {
        const Box box = boxes[binary_node(opened[count])];
        for (uint axis = 0; axis < 3; ++axis) {
            all.lower[axis] = lesser(all.lower[axis], box.lower[axis]);
            all.upper[axis] = greater(all.upper[axis], box.upper[axis]);
            assignment.offset[count][axis] = (double)box.lower[axis] + (double)box.upper[axis];
        }
    }
    for (uint child = 0; child < count; ++child)
        for (uint axis = 0; axis < 3; ++axis)
            assignment.offset[child][axis] -= (double)all.lower[axis] + (double)all.upper[axis];
    for (uint slot = 0; slot <= ENTRY; ++slot) {
        assignment.slot_price[slot] = 0.0;
        assignment.child_in[slot] = NOBODY;
        assignment.before[slot] = ENTRY;
    }
    for (uint child = 0; child < 8; ++child) assignment.child_price[child] = 0.0;
    for (uint child = 0; child < count; ++child) add_child(&assignment, child);

    uint slots[8];
    for (uint slot = 0; slot < 8; ++slot) {
        const uint child = assignment.child_in[slot];
        slots[slot] = child == NOBODY ? NO_CHILD : opened[child];
    }
    for (uint slot = 0; slot < 8; ++slot) opened[slot] = slots[slot];
}

// --- quantising ---------------------------------------------------------------------------------
// bvh/quantise.h gives the bounds.

#define LEAST_EXPONENT (-126)
#define BIAS 127
#define MOST_STEPS 255U

static float power_of_two(int exponent) {
    return as_float((uint)(exponent + BIAS) << 23);
}

/// As CompressedNode::plane: the product is exact.
static float plane(float origin, float step, uint multiple) {
    return origin + (float)multiple * step;
}

static uint most_or(double steps) {
    return (uint)(MOST_STEPS < steps ? (double)MOST_STEPS : steps);
}

static uint below(float origin, float step, float lower) {
    uint multiple = most_or(floor(((double)lower - (double)origin) / (double)step));
    while (plane(origin, step, multiple) > lower) --multiple;  // ends at the origin
    return multiple;
}

static uint above(float origin, float step, float upper) {
    uint multiple = most_or(ceil(((double)upper - (double)origin) / (double)step));
    while (plane(origin, step, multiple) < upper) ++multiple;  // ends at the last
    return multiple;
}

/// The least exponent with which 255 steps lead from `lower` to `upper` or beyond.
static int exponent_for(float lower, float upper) {
    const double step = ((double)upper - (double)lower) / (double)MOST_STEPS;
    if (step == 0.0) return LEAST_EXPONENT;
    // No difference of floats is denormal as a double: step is f 2^e with f in [1, 2).
    const ulong bits = as_ulong(step);
    int exponent = (int)(bits >> 52) - 1023;
    if ((bits & 0xFFFFFFFFFFFFFUL) != 0) ++exponent;
    exponent = max(exponent, LEAST_EXPONENT);
    // The quotient's rounding may have cost one.
    while (plane(lower, power_of_two(exponent), MOST_STEPS) < upper) ++exponent;
    return exponent;
}

// --- kernels ------------------------------------------------------------------------------------

#define FIRST_INTERIOR 24U

/// Sets origin, exponents and planes of a node (bvh/compressed_bvh.h) to hold its children's boxes.
/// Returns the three exponents, biased, from the lowest byte on.
static uint quantise(global const Box* boxes, global const uint* slots, global uint* node) {
    uint exponents = 0;
    for (uint axis = 0; axis < 3; ++axis) {
        float lowest = INFINITY, highest = -INFINITY;
        for (uint slot = 0; slot < 8; ++slot) {
            if (is_missing(slots[slot])) continue;
            global const Box* const box = &boxes[binary_node(slots[slot])];
            lowest = lesser(lowest, box->lower[axis]);
            highest = greater(highest, box->upper[axis]);
        }
        const int exponent = exponent_for(lowest, highest);
        const float step = power_of_two(exponent);
        exponents |= (uint)(exponent + BIAS) << 8U * axis;
        uint lower[2] = {0, 0}, upper[2] = {0, 0};  // four slots each
        for (uint slot = 0; slot < 8; ++slot) {
            uint from = MOST_STEPS, to = 0;  // a missing child decodes to an empty box
            if (!is_missing(slots[slot])) {
                global const Box* const box = &boxes[binary_node(slots[slot])];
                from = below(lowest, step, box->lower[axis]);
                to = above(lowest, step, box->upper[axis]);
            }
            lower[slot / 4] |= from << 8U * (slot % 4);
            upper[slot / 4] |= to << 8U * (slot % 4);
        }
        node[axis] = as_uint(lowest);
        for (uint word = 0; word < 2; ++word) {
            node[8 + 2 * axis + word] = lower[word];
            node[14 + 2 * axis + word] = upper[word];
        }
    }
    return exponents;
}

/// Fills nodes of 80 bytes.
kernel void fill_compressed_nodes(
    global const Box* boxes,         // of the binary tree's nodes
    global const uint2* plans,       // of its interior nodes
    uint first_leaf,                 // number of these
    uint count,                      // wide nodes
    uint start,                      // of these, that of the first work-item
    global const uint* opened,       // children, by slot, 8 for each wide node
    global const uint* first_child,  // by wide node
    global const uint* blocks,       // first reference of its leaves, by wide node
    global uint* nodes)              // out: 20 for each wide node
{
    const uint wide = start + (uint)get_global_id(0);
    if (wide >= count) return;
    const Planned tree = {0, plans, boxes, first_leaf};
    global const uint* const slots = opened + (size_t)wide * 8;
    global uint* const node = nodes + (size_t)wide * 20;
    uint interior_mask = 0, offset = 0;
    uint meta[2] = {0, 0};  // four slots each
    for (uint slot = 0; slot < 8; ++slot) {
        uint bits = 0;
        if (is_interior(slots[slot])) {
            interior_mask |= 1U << slot;
            bits = 1U << 5U | (FIRST_INTERIOR + slot);
        } else if (is_leaf(slots[slot])) {
            const uint size = size_below(tree, binary_node(slots[slot]));
            bits = ((1U << size) - 1U) << 5U | offset;  // as many bits as there are references
            offset += size;
        }
        meta[slot / 4] |= bits << 8U * (slot % 4);
    }
    const uint exponents = quantise(boxes, slots, node);
    node[3] = exponents | interior_mask << 24U;
    node[4] = first_child[wide];
    node[5] = blocks[wide];
    node[6] = meta[0];
    node[7] = meta[1];
}

/// Fills the corners of a leaf's references, one to a work-item: rows of as many coordinates as the
/// leaf has references.
kernel void fill_corners(global const float* vertices,  // of the mesh, 3 each
                         global const uint* triangles,  // of the mesh, 3 vertices each
                         uint count,                    // references
                         uint start,                    // that of the first work-item
                         global uint* lanes,            // of list_references; out: the triangles
                         global uint* corners)          // out: 9 for each reference
{
    const uint i = start + (uint)get_global_id(0);
    if (i >= count) return;
    const uint triangle = lanes[i] & 0x0FFFFFFFU;
    const uint lane = lanes[i] >> 28U & 3U, size = (lanes[i] >> 30U) + 1U;
    global uint* const rows = corners + 9 * (size_t)(i - lane) + lane;
    for (uint corner = 0; corner < 3; ++corner) {
        const size_t vertex = triangles[3 * (size_t)triangle + corner];
        for (uint axis = 0; axis < 3; ++axis)
            rows[(3 * corner + axis) * size] = as_uint(vertices[3 * vertex + axis]);
    }
    lanes[i] = triangle;
}
