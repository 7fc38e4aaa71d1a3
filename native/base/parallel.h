// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <chrono>
#include <cstddef>
#include <utility>

#include "base/fork_join.h"
#include "base/room.h"
#include "base/token.h"

namespace bvhlab {

/// Threads that `with_threads(threads, ...)` uses.
inline int thread_count(int threads) {
    return threads > 0 ? threads : tbb::this_task_arena::max_concurrency();
}

/// Runs `function` with at most `threads` threads; 0 means all that oneTBB would use. Throws
/// std::bad_alloc where there is no room to start them.
template <class Function>
decltype(auto) with_threads(int threads, Function&& function) {
    require_room_for_threads(1);  // before oneTBB is asked for anything
    require_room_for_threads(thread_count(threads));
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    const ForkJoin call;
    return arena.execute(call.task(std::forward<Function>(function)));
}

/// After a parallel call: once a task of the group that the caller runs in has thrown, oneTBB
/// leaves the calls of its other tasks early and *without* an exception, so that results are
/// missing. Throws Cancelled then, which goes no farther than the group: that passes on what was
/// thrown first.
inline void leave_cancelled_group() {
    if (tbb::is_current_task_group_canceling()) throw Cancelled();
}

using IndexRange = tbb::blocked_range<std::size_t>;

/// Calls `body(range)` for parts of [begin, end) of at most `grain` indices, a task each. The
/// result must not depend on the order of calls.
template <class Body>
void parallel_for_ranges(std::size_t begin, std::size_t end, std::size_t grain, const Body& body) {
    const ForkJoin call;
    tbb::parallel_for(IndexRange(begin, end, grain),
                      call.task([&](const IndexRange& range) { body(range); }),
                      tbb::simple_partitioner());  // others make tasks far larger than the grain
    leave_cancelled_group();
}

/// Calls `body(i)` for every i in [0, count), at most `grain` indices to a task, checking the token
/// once a task. The result must not depend on the order of calls.
template <class Body>
void parallel_for_each(std::size_t count, std::size_t grain, const Token& token, Body&& body) {
    parallel_for_ranges(0, count, grain, [&](const IndexRange& range) {
        token.check();
        for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
    });
}

/// Adds up [begin, end): `add(range, sum)` returns `sum` and what the range adds to it, for parts
/// of at most `grain` indices. Which parts are added to which depends on the arguments alone, so
/// that floating-point sums are the same at any thread count.
template <class Sum, class Add>
Sum parallel_sum(std::size_t begin, std::size_t end, std::size_t grain, const Sum& zero,
                 const Add& add) {
    const ForkJoin call;
    Sum sum = tbb::parallel_deterministic_reduce(
        IndexRange(begin, end, grain), zero,
        call.task([&](const IndexRange& range, Sum part) { return add(range, part); }),
        call.task([](Sum left, Sum right) { return left + right; }));
    leave_cancelled_group();
    return sum;
}

/// Calls both functions, which may run at the same time.
template <class First, class Second>
void parallel_invoke(const First& first, const Second& second) {
    const ForkJoin call;
    tbb::parallel_invoke(call.task([&] { first(); }), call.task([&] { second(); }));
    leave_cancelled_group();
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
