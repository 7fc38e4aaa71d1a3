// SPDX-License-Identifier: GPL-3.0-or-later
// Shows whether a device's sub-groups do what team.cl takes them to do: each operation is held
// against local memory. Device::check_sub_groups says what must come of it.

enum { wrong_numbers, wrong_votes, wrong_meetings, wrong_shuffles };

kernel void check_team(global uint* wrong,          // by kind of operation, 0 at first
                       volatile global uint* next,  // the numbers that are taken, 0 at first
                       global uint* taken,          // by number: how often, 0 at first
                       local uint* words,           // of each thread
                       local uint* others) {        // as many
    const uint thread = thread_of_group(), count = (uint)get_local_size(0);
    const uint lane = get_sub_group_local_id(), size = get_sub_group_size();
    const uint begin = thread - lane;
    const uint word = thread * 2654435761U + (uint)get_group_id(0);
    if (thread < count) words[thread] = word;
    barrier(CLK_LOCAL_MEM_FENCE);

    // A number for each thread, and sub-groups of the same size but for the last.
    const bool numbered = thread < count && words[thread] == word && begin + size <= count &&
                          (size == get_max_sub_group_size() || begin + size == count);
    if (!numbered) atomic_inc(&wrong[wrong_numbers]);
    const uint end = min(begin + size, count);

    // Rounds whose outcomes differ from one to the next, within and among sub-groups, so that what
    // is left from one is seen in the next.
    for (uint round = 0; round < 64; ++round) {
        bool any = false;
        for (uint i = begin; i < end; ++i) any |= words[i] % 64 == round;
        if (vote(word % 64 == round) != any) atomic_inc(&wrong[wrong_votes]);
    }
    for (uint round = 0; round < 8; ++round) {
        const bool wants = word % 8 == round;
        const uint number = take_next(wants, next);
        if (wants && number < (uint)get_global_size(0)) atomic_inc(&taken[number]);
    }
#ifdef HAS_SHUFFLES
    for (uint round = 0; round < size; ++round) {
        const uint from = (lane * 3 + round) % size;
        if (shuffled(word + round, from) != words[min(begin + from, count - 1)] + round)
            atomic_inc(&wrong[wrong_shuffles]);
    }
#endif

    // Local memory that another thread wrote.
    others[min(thread, count - 1)] = ~word;
    MEET();
    const uint other = min(begin + (lane + 1) % size, count - 1);
    if (others[other] != ~words[other]) atomic_inc(&wrong[wrong_meetings]);
}
