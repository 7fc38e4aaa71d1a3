// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <cstddef>
#include <utility>

#include "base/token.h"

namespace bvhlab {

/// Runs `function` with at most `threads` threads; 0 means all that oneTBB would use.
template <class Function>
decltype(auto) with_threads(int threads, Function&& function) {
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    return arena.execute(std::forward<Function>(function));
}

/// Threads that `with_threads(threads, ...)` uses.
inline int thread_count(int threads) {
    return threads > 0 ? threads : tbb::this_task_arena::max_concurrency();
}

/// Calls `body(i)` for every i in [0, count), at most `grain` indices to a task, checking the token
/// once a task. The result must not depend on the order of calls.
template <class Body>
void parallel_for_each(std::size_t count, std::size_t grain, const Token& token, Body&& body) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, count, grain),
        [&](const tbb::blocked_range<std::size_t>& range) {
            token.check();
            for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
        },
        tbb::simple_partitioner());  // others make tasks far larger than the grain
}

/// Wall-clock seconds since construction.
class Stopwatch {
public:
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace bvhlab
