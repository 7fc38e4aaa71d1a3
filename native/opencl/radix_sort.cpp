// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/radix_sort.h"

#include <algorithm>
#include <string>
#include <utility>

#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

constexpr int run_digit_bits = 8;
constexpr std::size_t run_size = 8192;  // keys of a run

// With these, a tile's keys, values and counters take at most 32 KiB of local memory.
constexpr int tile_digit_bits = 5;
constexpr std::size_t keys_per_item = 8;
constexpr std::size_t largest_tile_group = 128;

/// The buffers of one pass, and how many keys there are.
template <class Key>
struct Pass {
    const Buffer<Key>&keys, &sorted_keys;
    const Buffer<std::uint32_t>&values, &sorted_values;
    std::uint32_t count;
};

template <class Key>
ProgramSource source(int digit_bits) {
    const std::string key = sizeof(Key) == 8 ? "ulong" : "uint";
    return {{"scan.cl", "radix_sort.cl"},
            "-DKEY=" + key + " -DDIGIT_BITS=" + std::to_string(digit_bits) +
                " -DKEYS_PER_ITEM=" + std::to_string(keys_per_item)};
}

/// Sorts by runs of run_size keys, one to a work-item and a work-group: more would only share a
/// core's cache.
template <class Key>
class Runs {
public:
    static constexpr int digit_bits = run_digit_bits;

    Runs(Commands& commands, std::size_t count)
        : commands_(commands),
          program_(commands.device(), source<Key>(digit_bits)),
          scan_(commands),
          runs_((count + run_size - 1) / run_size),
          counts_(commands.buffer<std::uint32_t>(runs_ << digit_bits)),
          total_(commands.buffer<std::uint32_t>(1)) {}

    void operator()(const Pass<Key>& pass, std::uint32_t shift) {
        const Range range(runs_, 1);
        const std::uint32_t size = run_size, runs = std::uint32_t(runs_);
        commands_.run(program_["count_runs"], range, pass.keys, pass.count, shift, size, runs,
                      counts_);
        scan_(counts_, counts_.size(), total_);
        commands_.run(program_["scatter_runs"], range, pass.keys, pass.values, pass.count, shift,
                      size, runs, counts_, pass.sorted_keys, pass.sorted_values);
    }

private:
    Commands& commands_;
    Program program_;
    Scan scan_;
    std::size_t runs_;
    Buffer<std::uint32_t> counts_, total_;
};

/// Sorts by tiles of keys_per_item keys to a work-item.
template <class Key>
class Tiles {
public:
    static constexpr int digit_bits = tile_digit_bits;

    Tiles(Commands& commands, std::size_t count)
        : commands_(commands),
          program_(commands.device(), source<Key>(digit_bits)),
          scan_(commands),
          group_(std::min({commands.work_group, largest_tile_group,
                           program_["count_tiles"].largest_group,
                           program_["scatter_tiles"].largest_group})),
          tiles_((count + group_ * keys_per_item - 1) / (group_ * keys_per_item)),
          counts_(commands.buffer<std::uint32_t>(tiles_ << digit_bits)),
          total_(commands.buffer<std::uint32_t>(1)) {}

    void operator()(const Pass<Key>& pass, std::uint32_t shift) {
        const Range range(tiles_ * group_, group_);
        const auto tiles = std::uint32_t(tiles_);
        const std::size_t counter_count = group_ << digit_bits;
        const Local counters{(counter_count + counter_count / 32 + 1) * sizeof(std::uint32_t)};
        const std::size_t keys = group_ * keys_per_item;
        commands_.run(program_["count_tiles"], range, pass.keys, pass.count, shift, tiles, counts_,
                      counters);
        scan_(counts_, counts_.size(), total_);
        commands_.run(program_["scatter_tiles"], range, pass.keys, pass.values, pass.count, shift,
                      tiles, counts_, pass.sorted_keys, pass.sorted_values,
                      Local{keys * sizeof(Key)}, Local{keys * sizeof(std::uint32_t)}, counters,
                      Local{sizeof(std::uint32_t) << digit_bits},
                      Local{group_ * sizeof(std::uint32_t)});
    }

private:
    Commands& commands_;
    Program program_;
    Scan scan_;
    std::size_t group_, tiles_;
    Buffer<std::uint32_t> counts_, total_;
};

template <template <class> class Parts, class Key>
void sort_parts(Commands& commands, Buffer<Key>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, int key_bits) {
    if (count < 2) return;
    auto sorted_keys = commands.buffer<Key>(keys.size());
    auto sorted_values = commands.buffer<std::uint32_t>(values.size());
    Parts<Key> sort_by_digit(commands, count);
    for (int shift = 0; shift < key_bits; shift += Parts<Key>::digit_bits) {
        sort_by_digit({keys, sorted_keys, values, sorted_values, std::uint32_t(count)},
                      std::uint32_t(shift));
        std::swap(keys, sorted_keys);
        std::swap(values, sorted_values);
    }
}

template <class Key>
void sort(Commands& commands, Buffer<Key>& keys, Buffer<std::uint32_t>& values, std::size_t count,
          int key_bits) {
    if (commands.suits_gpu)
        sort_parts<Tiles>(commands, keys, values, count, key_bits);
    else
        sort_parts<Runs>(commands, keys, values, count, key_bits);
}

}  // namespace

void radix_sort(Commands& commands, Buffer<std::uint64_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, int key_bits) {
    sort(commands, keys, values, count, key_bits);
}

void radix_sort(Commands& commands, Buffer<std::uint32_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, int key_bits) {
    sort(commands, keys, values, count, key_bits);
}

}  // namespace bvhlab::opencl
