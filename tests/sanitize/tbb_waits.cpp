// SPDX-License-Identifier: GPL-3.0-or-later
// oneTBB's waits, as ThreadSanitizer has to be told of them: the last task of a call wakes the
// waiting thread inside libtbb, which is not instrumented, so the thread's stack, where oneTBB
// keeps its counters, would seem to be used again too early. These functions stand before libtbb's
// own.
#include <dlfcn.h>
#include <sanitizer/tsan_interface.h>
#include <tbb/task_group.h>

namespace tbb::detail::r1 {
namespace {

template <class Function>
Function* next(const char* mangled) {
    return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, mangled));
}

}  // namespace

#define VISIBLE __attribute__((visibility("default")))

VISIBLE void notify_waiters(std::uintptr_t wait_context) {
    static const auto real = next<void(std::uintptr_t)>("_ZN3tbb6detail2r114notify_waitersEm");
    __tsan_release(reinterpret_cast<void*>(wait_context));
    real(wait_context);
}

VISIBLE void wait(d1::wait_context& waited, d1::task_group_context& context) {
    static const auto real = next<void(d1::wait_context&, d1::task_group_context&)>(
        "_ZN3tbb6detail2r14waitERNS0_2d112wait_contextERNS2_18task_group_contextE");
    real(waited, context);
    __tsan_acquire(&waited);
}

VISIBLE void execute_and_wait(d1::task& task, d1::task_group_context& context,
                              d1::wait_context& waited, d1::task_group_context& waited_context) {
    static const auto real = next<void(d1::task&, d1::task_group_context&, d1::wait_context&,
                                       d1::task_group_context&)>(
        "_ZN3tbb6detail2r116execute_and_waitERNS0_2d14taskERNS2_18task_group_contextERNS2_12wait_"
        "contextES6_");
    real(task, context, waited, waited_context);
    __tsan_acquire(&waited);
}

}  // namespace tbb::detail::r1
