// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/array.h"
#include "base/parallel.h"

namespace bvhlab {

/// The indices i in [0, count) for which `keep(i)`, in ascending order whatever the threads.
/// `keep` is called twice for each index; count must be below 2^32.
template <class Keep>
Array<std::uint32_t> compact(std::size_t count, const Token& token, Keep&& keep) {
    constexpr std::size_t block = 4096;
    const std::size_t blocks = (count + block - 1) / block;
    const auto end_of = [&](std::size_t b) { return std::min(count, (b + 1) * block); };

    std::vector<std::size_t> starts(blocks + 1, 0);
    parallel_for_each(blocks, 1, token, [&](std::size_t b) {
        for (std::size_t i = b * block; i < end_of(b); ++i) starts[b + 1] += keep(i) ? 1 : 0;
    });
    for (std::size_t b = 0; b < blocks; ++b) starts[b + 1] += starts[b];

    Array<std::uint32_t> kept(starts[blocks]);
    parallel_for_each(blocks, 1, token, [&](std::size_t b) {
        std::size_t place = starts[b];
        for (std::size_t i = b * block; i < end_of(b); ++i)
            if (keep(i)) kept[place++] = std::uint32_t(i);
    });
    return kept;
}

}  // namespace bvhlab
