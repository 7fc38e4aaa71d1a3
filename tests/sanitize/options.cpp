// SPDX-License-Identifier: GPL-3.0-or-later
// What the sanitizers' runtimes ask the test program. All suppressions are of others' libraries,
// none of our code.

extern "C" {

__attribute__((visibility("default"))) const char* __asan_default_options() {
    return "detect_stack_use_after_return=1:check_initialization_order=1:strict_init_order=1";
}

__attribute__((visibility("default"))) const char* __ubsan_default_options() {
    return "print_stacktrace=1";
}

__attribute__((visibility("default"))) const char* __tsan_default_options() {
    // The slots of a deadlock detector fill up with oneTBB's locks, which it cannot see unlocked.
    return "detect_deadlocks=0:history_size=4";
}

__attribute__((visibility("default"))) const char* __tsan_default_suppressions() {
    // Libraries that are not instrumented: what they synchronise with atomics is not seen, so their
    // own calls of malloc, memcpy and the like would be reported.
    // The counters of oneTBB's task trees: handed over inside libtbb with the tasks. No code of
    // ours runs below these functions, so nothing of ours is hidden.
    return "race:fold_tree\n"
           "race:check_being_stolen\n"
           "race:wait_context::add_reference\n"
           "race:^add_reference$\n"
           "called_from_lib:libtbb.so\n"
           "called_from_lib:libtbbmalloc.so\n"
           "called_from_lib:libembree3.so\n"
           "called_from_lib:libembree4.so\n"
           "called_from_lib:libOpenImageIO.so\n"
           "called_from_lib:libOpenImageIO_Util.so\n"
           // At exit libtbbmalloc unlocks, by a jump from there, what was locked unseen.
           "called_from_lib:libc.so.6\n";
}
}
