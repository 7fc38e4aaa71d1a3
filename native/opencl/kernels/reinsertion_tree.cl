// SPDX-License-Identifier: GPL-3.0-or-later
// The tree that the reinsertion kernels work on, as in build/reinsertion_tree.h: the slots 2i and
// 2i + 1 of pair i hold two siblings; the root is in slot 0, and slot 1 is not used.

#define LEAF_FLAG 0x80000000U
#define ROOT 0U

// --- two boxes side by side ---------------------------------------------------------------------

/// Upper bounds are negated, so that a union is three minima.
typedef struct {
    float4 lower_xy;          // x0, x1, y0, y1
    float4 negated_upper_xy;  // the same of the upper corners, negated
    float4 z;                 // lower z0, z1, then negated upper z0, z1
} BoxPair;

/// As std::min and unlike fmin: which of +0 and -0 is taken must not be left to the device.
static float4 least(float4 a, float4 b) {
    return a < b ? a : b;
}

static BoxPair unite_pairs(BoxPair a, BoxPair b) {
    return (BoxPair){least(a.lower_xy, b.lower_xy), least(a.negated_upper_xy, b.negated_upper_xy),
                     least(a.z, b.z)};
}

/// Half the surface areas of both boxes, in the order of operations of the host.
static float2 half_areas(BoxPair boxes) {
    const float4 xy = boxes.lower_xy + boxes.negated_upper_xy;  // negated extents
    const float2 z = boxes.z.xy + boxes.z.zw;
    return xy.xy * xy.zw + z * (xy.xy + xy.zw);
}

/// The box of one side on both sides.
static BoxPair repeat_side(BoxPair boxes, uint side) {
    return side == 0 ? (BoxPair){boxes.lower_xy.xxzz, boxes.negated_upper_xy.xxzz, boxes.z.xxzz}
                     : (BoxPair){boxes.lower_xy.yyww, boxes.negated_upper_xy.yyww, boxes.z.yyww};
}

static BoxPair swap_sides(BoxPair boxes) {
    return (BoxPair){boxes.lower_xy.yxwz, boxes.negated_upper_xy.yxwz, boxes.z.yxwz};
}

/// On which sides two pairs have different boxes.
static int2 differ(BoxPair a, BoxPair b) {
    const int4 lanes =
        (a.lower_xy != b.lower_xy) | (a.negated_upper_xy != b.negated_upper_xy) | (a.z != b.z);
    return lanes.xy | lanes.zw;
}

// --- pairs of slots -----------------------------------------------------------------------------

/// The two children of one interior node: 64 bytes, as on the host.
typedef struct {
    BoxPair boxes;
    float2 half_area;
    uint2 child;  // pair of the node's children, or LEAF_FLAG + leaf number
} SlotPair;

static bool is_leaf(uint child) {
    return (child & LEAF_FLAG) != 0;
}

static uint of_side(uint2 values, uint side) {
    return side == 0 ? values.x : values.y;
}

static uint child_of(global const SlotPair* pairs, uint slot) {
    return of_side(pairs[slot >> 1].child, slot & 1);
}

static float half_area_of(global const SlotPair* pairs, uint slot) {
    const float2 areas = pairs[slot >> 1].half_area;
    return (slot & 1) == 0 ? areas.x : areas.y;
}

// One side is written lane by lane, as another work-item may be writing the other.

static void set_lanes(global float4* vector, uint side, float first, float second) {
    global float* lanes = (global float*)vector;
    lanes[side] = first;
    lanes[side + 2] = second;
}

static void set_half_area(global SlotPair* pair, uint side, float area) {
    ((global float*)&pair->half_area)[side] = area;
}

/// Writes the box that `repeated` holds on both sides.
static void set_box(global SlotPair* pair, uint side, BoxPair repeated) {
    const bool left = side == 0;
    const float4 lower = repeated.lower_xy, upper = repeated.negated_upper_xy, z = repeated.z;
    set_lanes(&pair->boxes.lower_xy, side, left ? lower.x : lower.y, left ? lower.z : lower.w);
    set_lanes(&pair->boxes.negated_upper_xy, side, left ? upper.x : upper.y,
              left ? upper.z : upper.w);
    set_lanes(&pair->boxes.z, side, left ? z.x : z.y, left ? z.z : z.w);
    set_half_area(pair, side, half_areas(repeated).x);
}

/// Makes `child`, a leaf or a pair, what is below a slot.
static void set_child(global SlotPair* pairs, global uint* parents, uint slot, uint child) {
    ((global uint*)&pairs[slot >> 1].child)[slot & 1] = child;
    if (!is_leaf(child)) parents[child] = slot;
}

// --- reinsertions -------------------------------------------------------------------------------

#define NO_TARGET 0U

/// build/reinsertion_search.h, 12 bytes
typedef struct {
    float gain;
    uint target, pivot;
} Reinsertion;

// --- lists --------------------------------------------------------------------------------------

/// Appends `value` where it is wanted; one global atomic to a work-group. All work-items of the
/// group must come here, and nothing may depend on the order of the list.
static void append(bool wanted, uint value, global uint* list, volatile global uint* count,
                   volatile local uint* shared) {
    if (get_local_id(0) == 0) shared[0] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint place = wanted ? atomic_inc(&shared[0]) : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0) shared[1] = atomic_add(count, shared[0]);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (wanted) list[shared[1] + place] = value;
}
