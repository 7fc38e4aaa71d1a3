// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/cache_aligned_allocator.h>

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace bvhlab {

#ifdef BVHLAB_SANITIZE
/// Sanitizers see nothing of what happens in oneTBB's own memory: here each array is a block.
template <class T>
struct CacheAlignedAllocator {
    using value_type = T;
    static constexpr std::align_val_t alignment{128};  // as oneTBB's

    T* allocate(std::size_t count) {
        if (count > std::size_t(PTRDIFF_MAX) / sizeof(T)) throw std::bad_array_new_length();
        return static_cast<T*>(::operator new(count * sizeof(T), alignment));
    }
    void deallocate(T* block, std::size_t) { ::operator delete(block, alignment); }
    bool operator==(const CacheAlignedAllocator&) const = default;
};
#else
template <class T>
using CacheAlignedAllocator = tbb::cache_aligned_allocator<T>;
#endif

/// Allocator that leaves new elements of trivial type uninitialised: large arrays are first touched
/// by the threads that fill them, not zeroed by one. Memory is aligned to a cache line.
template <class T>
struct UninitialisedAllocator : CacheAlignedAllocator<T> {
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
