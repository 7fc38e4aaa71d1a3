// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/room.h"

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <new>

namespace bvhlab {
namespace {

constexpr std::size_t task_bytes = 1U << 20U;    ///< of a call: arena, tasks; far less in fact
constexpr std::size_t start_bytes = 16U << 20U;  ///< oneTBB's scheduler and allocator, about half
constexpr std::size_t stack_bytes = 5U << 20U;   ///< of a worker: 4 MiB, a guard page, its own data

std::atomic<int> granted{0};  ///< threads

}  // namespace

void require_room_for_threads(int threads) {
    const int more = std::max(threads - granted.load(), 0);
    const std::size_t bytes = more > 0 ? start_bytes + std::size_t(more) * stack_bytes : task_bytes;
    // Never touched: it costs address space alone, which limits and strict overcommit count.
    void* const room =
        mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room == MAP_FAILED) throw std::bad_alloc();
    munmap(room, bytes);
    if (more > 0) granted = threads;
}

}  // namespace bvhlab
