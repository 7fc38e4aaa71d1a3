// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace bvhlab {

/// Throws std::bad_alloc where the process has no room left for oneTBB to start `threads` threads.
///
/// oneTBB 2021 does not survive its own lack of memory: where a worker cannot be started, or the
/// first use fails, locks and counters stay as they are, and the next call waits for ever. So the
/// room is asked for beforehand. Threads that were granted once are not counted again: oneTBB keeps
/// them.
void require_room_for_threads(int threads);

}  // namespace bvhlab
