// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/radix_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "base/parallel.h"

namespace bvhlab {
namespace {

/// The order that std::stable_sort gives.
Array<std::uint32_t> expected_order(const Array<std::uint64_t>& keys) {
    Array<std::uint32_t> order(keys.size());
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return keys[i]; });
    return order;
}

void check(const Array<std::uint64_t>& keys, int bits) {
    for (const int threads : {1, 3}) {
        Array<std::uint64_t> sorted = keys;
        Array<std::uint32_t> values(keys.size());
        std::iota(values.begin(), values.end(), 0U);
        with_threads(threads, [&] { radix_sort(sorted, values, bits, Token{}); });
        EXPECT_EQ(values, expected_order(keys));
        EXPECT_TRUE(std::ranges::is_sorted(sorted));
    }
}

TEST(RadixSort, SortsStably) {
    std::mt19937_64 random(7);
    for (const std::size_t count : {0, 1, 2, 1000, 100000}) {
        for (const int bits : {4, 32, 60, 64}) {
            Array<std::uint64_t> keys(count);
            for (auto& key : keys) key = random() >> (64 - bits);
            check(keys, bits);
        }
    }
}

TEST(RadixSort, HandlesEqualKeysAndRangeEnds) {
    check(Array<std::uint64_t>(70000, 42), 60);
    check({~0ULL, 0, ~0ULL, 1, 0}, 64);
}

TEST(RadixSort, StopsWhenCancelled) {
    Token token;
    token.cancel();
    Array<std::uint64_t> keys(10, 1);
    Array<std::uint32_t> values(10, 0);
    EXPECT_THROW(radix_sort(keys, values, 8, token), Cancelled);
}

}  // namespace
}  // namespace bvhlab
