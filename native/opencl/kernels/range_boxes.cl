// SPDX-License-Identifier: GPL-3.0-or-later
// Boxes of runs of leaves. Above the leaves stand levels, each half as long as the one below it,
// that hold the unions of pairs; any run is the union of at most two boxes of each level. So every
// node of a tree whose leaves are in order gets its box by itself, with no need of one work-group
// to see what another wrote in the same launch, which OpenCL 1.2 does not promise.

// --- levels -------------------------------------------------------------------------------------

kernel void unite_pairs(global const Box* below,  // may be the same buffer as `above`
                        uint below_first,         // where the level below begins
                        uint below_count,         // its length
                        global Box* above,        // the level that is written
                        uint above_first)         // where it begins
{
    const uint i = (uint)get_global_id(0);
    if (i >= (below_count + 1) / 2) return;
    Box box = below[below_first + 2 * i];
    if (2 * i + 1 < below_count) box = unite(box, below[below_first + 2 * i + 1]);
    above[above_first + i] = box;
}

// --- queries ------------------------------------------------------------------------------------

/// The union of the leaves first..last, of `count` in all: left to right, which tells of 0 and -0
/// which is kept.
static Box range_box(global const Box* leaves, global const Box* levels, uint count, uint first,
                     uint last) {
    Box left = empty_box(), right = empty_box();
    global const Box* level = leaves;
    uint begin = first, end = last + 1;
    while (begin < end) {
        if (begin & 1) left = unite(left, level[begin++]);
        if (end & 1) right = unite(level[--end], right);
        begin /= 2;
        end /= 2;
        level = level == leaves ? levels : level + count;
        count = (count + 1) / 2;
    }
    return unite(left, right);
}
