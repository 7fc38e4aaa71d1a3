// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>

#include "base/fork_join.h"
#include "base/token.h"

namespace bvhlab {

/// Elements that one task handles in a parallel pass over the references of a large node. Smaller
/// nodes are handled by one thread. Trees do not depend on this number.
inline constexpr std::size_t chunk_size = 4096;

inline std::size_t chunk_count(std::size_t count) {
    return (count + chunk_size - 1) / chunk_size;
}

/// tbb::parallel_for over [0, count), to be used within a task. A thread that waits here takes up
/// no other node's work, so that stacks stay shallow. The loop has a context of its own: otherwise
/// oneTBB, when another task has thrown, would leave this loop early and *without* an exception,
/// and the caller would go on with half a result.
template <class Body>
void parallel_for_within_task(std::size_t count, Body&& body) {
    tbb::task_group_context context(tbb::task_group_context::isolated);
    const ForkJoin call;
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), count, std::size_t(1),
                          call.task([&](std::size_t i) { body(i); }), tbb::auto_partitioner(),
                          context);
    });
}

/// Calls `body(begin, end)` for each chunk of [0, count), in parallel where there are several, and
/// checks the token before each.
template <class Body>
void for_chunks(std::size_t count, const Token& token, Body&& body) {
    if (count <= chunk_size) {
        if (count > 0) body(std::size_t(0), count);
        return;
    }
    parallel_for_within_task(chunk_count(count), [&](std::size_t chunk) {
        token.check();
        const std::size_t begin = chunk * chunk_size;
        body(begin, std::min(count, begin + chunk_size));
    });
}

}  // namespace bvhlab
