// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>

#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define BVHLAB_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif
#endif

namespace bvhlab {

#ifdef BVHLAB_THREAD_SANITIZER

/// One parallel call, as ThreadSanitizer has to be told of it: oneTBB, which hands tasks from
/// thread to thread, is not built with it. What came before the call is seen by all its tasks, and
/// what these did is seen after it. Nothing is said of one task and another, so that all they share
/// is watched, whichever way oneTBB happened to run them.
///
/// Made by the caller before the call and destroyed after it; in other builds it does nothing.
class ForkJoin {
public:
    ForkJoin() { fork(); }
    ~ForkJoin() { __tsan_acquire(&joined_); }
    ForkJoin(const ForkJoin&) = delete;
    ForkJoin& operator=(const ForkJoin&) = delete;

    /// What the calling thread did up to now is seen by the tasks that start after.
    void fork() const { __tsan_release(&forked_); }

    /// `body`, to be handed to oneTBB. The call itself is not watched, as it reads its copy of
    /// `body` in oneTBB's memory; `body` is.
    template <class Body>
    auto task(Body body) const {
        return [ this, body ](
                   auto&&... arguments) __attribute__((no_sanitize("thread")))->decltype(auto) {
            const Body own = body;
            const Task task(*this);
            return own(std::forward<decltype(arguments)>(arguments)...);
        };
    }

private:
    struct Task {
        explicit Task(const ForkJoin& call) : call_(call) { __tsan_acquire(&call.forked_); }
        ~Task() { __tsan_release(&call_.joined_); }
        const ForkJoin& call_;
    };

    mutable char forked_ = 0, joined_ = 0;  // their addresses count
};

#else

struct ForkJoin {
    ForkJoin() {}  // not trivial: one that is never used again is no mistake
    void fork() const {}
    template <class Body>
    Body task(Body body) const {
        return body;
    }
};

#endif

}  // namespace bvhlab
