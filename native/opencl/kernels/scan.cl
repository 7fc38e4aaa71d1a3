// SPDX-License-Identifier: GPL-3.0-or-later
// Exclusive prefix sums: reduce, then scan (Merrill and Grimshaw 2009). The sums of tiles are
// scanned first, by these kernels again; then each tile goes on from what precedes it.

// Values of one work-item; those of a work-group are a tile.
#ifndef VALUES_PER_ITEM
#define VALUES_PER_ITEM 16
#endif

// --- sums within a work-group -------------------------------------------------------------------

/// The sum of the values of all work-items before this one. Every work-item must call it, with
/// partial[] of one element each; the last element is the sum of all then.
static uint sum_before(uint value, local uint* partial) {
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    partial[item] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint reach = 1; reach < size; reach *= 2) {
        const uint before = item >= reach ? partial[item - reach] : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        partial[item] += before;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    return partial[item] - value;
}

// --- tiles --------------------------------------------------------------------------------------

kernel void sum_tiles(global const uint* values,  // what is summed
                      uint count,                 // of values
                      global uint* sums,          // by tile
                      local uint* partial)        // by work-item
{
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    const size_t begin = get_group_id(0) * (size_t)size * VALUES_PER_ITEM;
    uint sum = 0;
    for (uint k = 0; k < VALUES_PER_ITEM; ++k) {
        const size_t i = begin + k * size + item;
        if (i < count) sum += values[i];
    }
    const uint before = sum_before(sum, partial);
    if (item == size - 1) sums[get_group_id(0)] = before + sum;
}

/// A place in the tile's local copy: one is left out after the values of each work-item, so that
/// work-items which walk their own do not meet in one memory bank.
static uint padded(uint i) {
    return i + i / VALUES_PER_ITEM;
}

kernel void scan_tiles(global uint* values,         // replaced by the sums of those before
                       uint count,                  // of values
                       global const uint* offsets,  // by tile: the sum before it
                       uint has_offsets,            // 0: there is one tile
                       global uint* total,          // written where there is one tile: its sum
                       local uint* tile,            // VALUES_PER_ITEM + 1 for each work-item
                       local uint* partial)         // by work-item
{
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    const size_t begin = get_group_id(0) * (size_t)size * VALUES_PER_ITEM;
    for (uint k = 0; k < VALUES_PER_ITEM; ++k) {
        const size_t i = begin + k * size + item;
        tile[padded(k * size + item)] = i < count ? values[i] : 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    // Each work-item sums its own, then writes what precedes each.
    const uint own = item * (VALUES_PER_ITEM + 1);
    uint sum = 0;
    for (uint k = 0; k < VALUES_PER_ITEM; ++k) sum += tile[own + k];
    const uint before = sum_before(sum, partial);
    if (!has_offsets && item == size - 1) total[0] = before + sum;
    uint place = before + (has_offsets ? offsets[get_group_id(0)] : 0);
    for (uint k = 0; k < VALUES_PER_ITEM; ++k) {
        const uint value = tile[own + k];
        tile[own + k] = place;
        place += value;
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    for (uint k = 0; k < VALUES_PER_ITEM; ++k) {
        const size_t i = begin + k * size + item;
        if (i < count) values[i] = tile[padded(k * size + item)];
    }
}
