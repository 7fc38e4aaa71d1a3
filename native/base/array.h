// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/cache_aligned_allocator.h>

#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace bvhlab {

/// Allocator that leaves new elements of trivial type uninitialised: large arrays are first touched
/// by the threads that fill them, not zeroed by one. Memory is aligned to a cache line.
template <class T>
struct UninitialisedAllocator : tbb::cache_aligned_allocator<T> {
    static_assert(std::is_trivially_destructible_v<T>);

    UninitialisedAllocator() = default;
    template <class U>
    UninitialisedAllocator(const UninitialisedAllocator<U>&) {}
    template <class U>
    struct rebind {
        using other = UninitialisedAllocator<U>;
    };

    template <class U>
    void construct(U* element) {
        ::new (static_cast<void*>(element)) U;
    }
    template <class U, class... Arguments>
    void construct(U* element, Arguments&&... arguments) {
        ::new (static_cast<void*>(element)) U(std::forward<Arguments>(arguments)...);
    }
};

/// A vector whose `Array<T>(n)` leaves elements of trivial type uninitialised.
template <class T>
using Array = std::vector<T, UninitialisedAllocator<T>>;

}  // namespace bvhlab
