// SPDX-License-Identifier: GPL-3.0-or-later
// Prefix sums and the radix sort on a device, for groups of any size.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "opencl/radix_sort.h"
#include "opencl/scan.h"

namespace bvhlab::opencl {
namespace {

constexpr std::size_t group_sizes[] = {3, 7, 64, 96};

using Values = std::vector<std::uint32_t>;

// --- scan ---------------------------------------------------------------------------------------

/// The scanned values, and their sum behind them.
Values scanned(std::size_t group, Values values) {
    const Token token;
    Commands commands(*Device::open("opencl"), token);
    commands.work_group = group;
    const auto buffer = commands.upload(std::span(values));
    const auto total = commands.buffer<std::uint32_t>(1);
    exclusive_scan(commands, buffer, values.size(), total);
    commands.download(buffer, std::span(values));
    values.push_back(commands.value(total, 0));
    return values;
}

Values expected_scan(Values values) {
    values.push_back(0);
    std::exclusive_scan(values.begin(), values.end(), values.begin(), 0U);
    return values;
}

TEST(OpenClScan, SumsWhatComesBefore) {
    std::mt19937 random(1);
    for (const std::size_t group : group_sizes) {
        const std::size_t tile = 16 * group;
        for (const std::size_t count :
             {std::size_t(0), std::size_t(1), std::size_t(2), tile - 1, tile, tile + 1, 2 * tile,
              tile * tile + 1, std::size_t(100003)}) {
            Values values(std::min<std::size_t>(count, 2000000));
            for (auto& value : values) value = std::uint32_t(random());
            EXPECT_EQ(scanned(group, values), expected_scan(values)) << group << " " << count;
        }
    }
}

TEST(OpenClScan, LeavesWhatIsBeyondTheCount) {
    const Token token;
    Commands commands(*Device::open("opencl"), token);
    const Values ones(1000, 1);
    const auto buffer = commands.upload(std::span(ones));
    const auto total = commands.buffer<std::uint32_t>(1);
    exclusive_scan(commands, buffer, 900, total);
    EXPECT_EQ(commands.value(buffer, 899), 899U);
    EXPECT_EQ(commands.value(buffer, 900), 1U);
    EXPECT_EQ(commands.value(total, 0), 900U);
}

// --- sort ---------------------------------------------------------------------------------------

template <class Key>
struct Sorted {
    std::vector<Key> keys;
    Values values;
};

template <class Key>
Sorted<Key> device_sorted(const std::vector<Key>& keys, int bits, bool suits_gpu,
                          std::size_t group) {
    const Token token;
    Commands commands(*Device::open("opencl"), token);
    commands.work_group = group;
    commands.suits_gpu = suits_gpu;
    Sorted<Key> sorted{keys, Values(keys.size())};
    std::iota(sorted.values.begin(), sorted.values.end(), 0U);
    auto key_buffer = commands.upload(std::span(sorted.keys));
    auto value_buffer = commands.upload(std::span(sorted.values));
    radix_sort(commands, key_buffer, value_buffer, keys.size(), bits);
    commands.download(key_buffer, std::span(sorted.keys));
    commands.download(value_buffer, std::span(sorted.values));
    return sorted;
}

template <class Key>
void check(const std::vector<Key>& keys, int bits, std::size_t group) {
    Values order(keys.size());
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return keys[i]; });
    std::vector<Key> sorted_keys;
    for (const std::uint32_t i : order) sorted_keys.push_back(keys[i]);
    for (const bool suits_gpu : {false, true}) {
        const auto sorted = device_sorted(keys, bits, suits_gpu, group);
        EXPECT_EQ(sorted.values, order)
            << keys.size() << " keys, group " << group << (suits_gpu ? ", as on a GPU" : "");
        EXPECT_EQ(sorted.keys, sorted_keys);
    }
}

template <class Key>
std::vector<Key> random_keys(std::size_t count, int bits) {
    std::mt19937_64 random(count);
    std::vector<Key> keys(count);
    for (Key& key : keys) key = Key(random() >> (64 - bits));
    return keys;
}

TEST(OpenClRadixSort, SortsStablyForAnyCountAndGroup) {
    for (const std::size_t group : group_sizes) {
        const std::size_t tile = 8 * group;
        for (const std::size_t count : {std::size_t(0), std::size_t(1), std::size_t(2), tile - 1,
                                        tile, tile + 1, std::size_t(8191), std::size_t(8193)}) {
            check(random_keys<std::uint64_t>(count, 6), 6, group);
            check(random_keys<std::uint64_t>(count, 60), 60, group);
            check(random_keys<std::uint32_t>(count, 30), 30, group);
        }
    }
}

TEST(OpenClRadixSort, SortsManyKeys) {
    check(random_keys<std::uint64_t>(200000, 64), 64, 64);
    check(random_keys<std::uint32_t>(200000, 32), 32, 96);
    check(random_keys<std::uint32_t>(200000, 1), 1, 64);
}

TEST(OpenClRadixSort, HandlesRangeEndsAndOrderedKeys) {
    constexpr std::uint64_t ends[] = {0, 1, (1ULL << 60) - 2, (1ULL << 60) - 1};
    std::vector<std::uint64_t> keys(30000);
    for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = ends[(i * i) % 4];
    check(keys, 60, 64);
    check(std::vector<std::uint64_t>(20000, 42), 60, 64);
    check(std::vector<std::uint64_t>(20000, ~0ULL), 64, 64);
    std::iota(keys.begin(), keys.end(), 0ULL);
    check(keys, 60, 64);
    std::ranges::reverse(keys);
    check(keys, 60, 64);
    check<std::uint32_t>({~0U, 0, ~0U, 1, 0}, 32, 7);
}

TEST(OpenClRadixSort, StopsWhenCancelled) {
    Token token;
    Commands commands(*Device::open("opencl"), token);
    auto keys = commands.buffer<std::uint64_t>(10);
    auto values = commands.buffer<std::uint32_t>(10);
    token.cancel();
    EXPECT_THROW(radix_sort(commands, keys, values, 10, 8), Cancelled);
}

}  // namespace
}  // namespace bvhlab::opencl
