// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/radix_sort.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "base/parallel.h"

namespace bvhlab {
namespace {

constexpr int digit_bits = 8;
constexpr std::size_t digit_count = std::size_t(1) << digit_bits;
constexpr std::size_t block_size = std::size_t(1) << 15;  // keys that one task counts and scatters

using Counts = std::array<std::uint32_t, digit_count>;

template <class Key>
std::size_t digit_of(Key key, int shift) {
    return std::size_t(key >> shift) & (digit_count - 1);
}

/// Turns counts by block and digit into the place where each block writes its first key of each
/// digit: all smaller digits first, then the same digit of earlier blocks, which keeps the sort
/// stable. Returns false where all keys share one digit, so that the pass can be skipped.
bool places_from_counts(std::vector<Counts>& blocks, std::size_t key_count) {
    std::uint32_t place = 0;
    for (std::size_t digit = 0; digit < digit_count; ++digit) {
        const std::uint32_t start = place;
        for (Counts& block : blocks) place += std::exchange(block[digit], place);
        if (place - start == key_count) return false;
    }
    return true;
}

template <class Key>
void sort(Array<Key>& keys, Array<std::uint32_t>& values, int key_bits, const Token& token) {
    const std::size_t count = keys.size();
    Array<Key> other_keys(count);
    Array<std::uint32_t> other_values(count);
    std::vector<Counts> blocks((count + block_size - 1) / block_size);

    for (int shift = 0; shift < key_bits; shift += digit_bits) {
        // Count the digits of each block.
        parallel_for_each(blocks.size(), 1, token, [&](std::size_t block) {
            Counts& counts = blocks[block];
            counts.fill(0);
            const std::size_t end = std::min(count, (block + 1) * block_size);
            for (std::size_t i = block * block_size; i < end; ++i)
                ++counts[digit_of(keys[i], shift)];
        });
        if (!places_from_counts(blocks, count)) continue;

        // Scatter each block in order.
        parallel_for_each(blocks.size(), 1, token, [&](std::size_t block) {
            Counts& places = blocks[block];
            const std::size_t end = std::min(count, (block + 1) * block_size);
            for (std::size_t i = block * block_size; i < end; ++i) {
                const std::uint32_t place = places[digit_of(keys[i], shift)]++;
                other_keys[place] = keys[i];
                other_values[place] = values[i];
            }
        });
        keys.swap(other_keys);
        values.swap(other_values);
    }
}

}  // namespace

void radix_sort(Array<std::uint64_t>& keys, Array<std::uint32_t>& values, int key_bits,
                const Token& token) {
    sort(keys, values, key_bits, token);
}

void radix_sort(Array<std::uint32_t>& keys, Array<std::uint32_t>& values, int key_bits,
                const Token& token) {
    sort(keys, values, key_bits, token);
}

}  // namespace bvhlab
