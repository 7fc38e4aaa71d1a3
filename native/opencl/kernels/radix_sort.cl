// SPDX-License-Identifier: GPL-3.0-or-later
// One pass of a stable radix sort by one digit (Merrill and Grimshaw 2011): count the digits of
// each part of the keys, scan the counts (digit by digit, and part by part within), scatter.
// A part is a run of one work-item on a CPU, and a tile of a work-group on a GPU.
// Needs scan.cl before it, and options:
//   KEY            ulong or uint
//   DIGIT_BITS     of one pass
//   KEYS_PER_ITEM  in a tile

#define DIGIT_COUNT (1U << DIGIT_BITS)

static uint digit_of(KEY key, uint shift) {
    return (uint)(key >> shift) & (DIGIT_COUNT - 1);
}

// --- runs ---------------------------------------------------------------------------------------
// A core takes one after the other; memory is written in as many streams as there are digits.

kernel void count_runs(global const KEY* keys,  // what is sorted
                       uint count,              // of keys
                       uint shift,              // of the digit
                       uint run_size,           // keys of a work-item
                       uint runs,               // how many of them
                       global uint* counts)     // by digit, then run
{
    const uint run = (uint)get_global_id(0);
    if (run >= runs) return;
    uint own[DIGIT_COUNT];
    for (uint digit = 0; digit < DIGIT_COUNT; ++digit) own[digit] = 0;
    const size_t begin = (size_t)run * run_size, end = min(begin + run_size, (size_t)count);
    for (size_t i = begin; i < end; ++i) ++own[digit_of(keys[i], shift)];
    for (uint digit = 0; digit < DIGIT_COUNT; ++digit)
        counts[(size_t)digit * runs + run] = own[digit];
}

kernel void scatter_runs(global const KEY* keys,     // what is sorted
                         global const uint* values,  // what goes with it
                         uint count,                 // of keys
                         uint shift,                 // of the digit
                         uint run_size,              // keys of a work-item
                         uint runs,                  // how many of them
                         global const uint* places,  // scanned counts
                         global KEY* sorted_keys,    // by this digit
                         global uint* sorted_values) {
    const uint run = (uint)get_global_id(0);
    if (run >= runs) return;
    uint own[DIGIT_COUNT];
    for (uint digit = 0; digit < DIGIT_COUNT; ++digit)
        own[digit] = places[(size_t)digit * runs + run];
    const size_t begin = (size_t)run * run_size, end = min(begin + run_size, (size_t)count);
    for (size_t i = begin; i < end; ++i) {
        const KEY key = keys[i];
        const uint place = own[digit_of(key, shift)]++;
        sorted_keys[place] = key;
        sorted_values[place] = values[i];
    }
}

// --- tiles --------------------------------------------------------------------------------------
// Sorted in local memory first, so that neighbouring work-items write to neighbouring places.

/// Work-items count in columns of their own, so no atomics are needed, and the order of equal
/// digits is that of work-items and, within one, of its keys. A row is one digit; one place is
/// left out after every 32, so that work-items which walk a part of the rows in turn spread over
/// the memory banks.
static uint counter_of(uint digit, uint item, uint size) {
    const uint i = digit * size + item;
    return i + i / 32;
}

static void clear_counters(local uint* counters) {
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    for (uint digit = 0; digit < DIGIT_COUNT; ++digit) counters[counter_of(digit, item, size)] = 0;
}

kernel void count_tiles(global const KEY* keys,  // what is sorted
                        uint count,              // of keys
                        uint shift,              // of the digit
                        uint tiles,              // as many as work-groups
                        global uint* counts,     // by digit, then tile
                        local uint* counters)    // DIGIT_COUNT * 33 / 32 for each work-item, + 1
{
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    const uint tile = (uint)get_group_id(0);
    const size_t begin = (size_t)tile * size * KEYS_PER_ITEM;
    clear_counters(counters);
    for (uint k = 0; k < KEYS_PER_ITEM; ++k) {
        const size_t i = begin + k * size + item;
        if (i < count) ++counters[counter_of(digit_of(keys[i], shift), item, size)];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint digit = item; digit < DIGIT_COUNT; digit += size) {
        uint sum = 0;
        for (uint k = 0; k < size; ++k) sum += counters[counter_of(digit, k, size)];
        counts[(size_t)digit * tiles + tile] = sum;
    }
}

/// Turns the counters into the place within the sorted tile where each work-item writes its first
/// key of each digit.
static void scan_counters(local uint* counters, local uint* partial) {
    const uint begin = (uint)get_local_id(0) * DIGIT_COUNT;
    uint sum = 0;
    for (uint i = begin; i < begin + DIGIT_COUNT; ++i) sum += counters[i + i / 32];
    uint place = sum_before(sum, partial);
    for (uint i = begin; i < begin + DIGIT_COUNT; ++i) {
        const uint value = counters[i + i / 32];
        counters[i + i / 32] = place;
        place += value;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}

kernel void scatter_tiles(global const KEY* keys,     // what is sorted
                          global const uint* values,  // what goes with it
                          uint count,                 // of keys
                          uint shift,                 // of the digit
                          uint tiles,                 // as many as work-groups
                          global const uint* places,  // scanned counts
                          global KEY* sorted_keys,    // by this digit
                          global uint* sorted_values,
                          local KEY* tile_keys,     // KEYS_PER_ITEM for each work-item
                          local uint* tile_values,  // as many
                          local uint* counters,     // DIGIT_COUNT * 33 / 32 for each work-item, + 1
                          local uint* shifts,       // by digit: from place in the tile to place
                          local uint* partial)      // by work-item
{
    const uint item = (uint)get_local_id(0), size = (uint)get_local_size(0);
    const uint tile = (uint)get_group_id(0);
    const size_t begin = (size_t)tile * size * KEYS_PER_ITEM;
    const uint tile_count = (uint)min((size_t)size * KEYS_PER_ITEM, count - begin);

    // Load the tile, and count each work-item's own keys in a row.
    for (uint i = item; i < tile_count; i += size) {
        tile_keys[i] = keys[begin + i];
        tile_values[i] = values[begin + i];
    }
    clear_counters(counters);
    barrier(CLK_LOCAL_MEM_FENCE);
    KEY own_keys[KEYS_PER_ITEM];
    uint own_values[KEYS_PER_ITEM];
    for (uint k = 0; k < KEYS_PER_ITEM; ++k) {
        const uint i = item * KEYS_PER_ITEM + k;
        if (i < tile_count) {
            own_keys[k] = tile_keys[i];
            own_values[k] = tile_values[i];
            ++counters[counter_of(digit_of(own_keys[k], shift), item, size)];
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    scan_counters(counters, partial);
    for (uint digit = item; digit < DIGIT_COUNT; digit += size)
        shifts[digit] = places[(size_t)digit * tiles + tile] - counters[counter_of(digit, 0, size)];
    barrier(CLK_LOCAL_MEM_FENCE);

    // Sort it in place, and write it out.
    for (uint k = 0; k < KEYS_PER_ITEM; ++k) {
        if (item * KEYS_PER_ITEM + k < tile_count) {
            const uint place = counters[counter_of(digit_of(own_keys[k], shift), item, size)]++;
            tile_keys[place] = own_keys[k];
            tile_values[place] = own_values[k];
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < tile_count; i += size) {
        const KEY key = tile_keys[i];
        const uint place = i + shifts[digit_of(key, shift)];
        sorted_keys[place] = key;
        sorted_values[place] = tile_values[i];
    }
}
