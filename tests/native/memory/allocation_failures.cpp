// SPDX-License-Identifier: GPL-3.0-or-later
// Memory that cannot be had, at any moment of a build: std::bad_alloc comes out, and the next build
// is right. An executable of its own, as it replaces operator new and oneTBB's allocation of tasks.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>

#include "../meshes.h"
#include "base/parallel.h"
#include "build/builder.h"
#include "bvh/collapse.h"
#include "trace/trace.h"

namespace {

std::atomic<std::int64_t> allocations{0};  ///< since the last arm()
std::atomic<std::int64_t> failing{-1};     ///< number of the one that fails; -1: none
std::atomic<std::int64_t> tasks{0};        ///< allocated since then
std::atomic<std::int64_t> failing_task{-1};

void arm(std::int64_t number, std::int64_t task = -1) {
    allocations = tasks = 0;
    failing = number;
    failing_task = task;
}

}  // namespace

// oneTBB's headers call this for each task but the halves of a loop's: it stands before libtbb's
// own.
namespace tbb::detail::r1 {

__attribute__((visibility("default"))) void* allocate(d1::small_object_pool*& pool,
                                                      std::size_t size) {
    using Allocate = void*(d1::small_object_pool*&, std::size_t);
    static const auto real = reinterpret_cast<Allocate*>(
        dlsym(RTLD_NEXT, "_ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm"));
    if (tasks.fetch_add(1) == failing_task.load()) throw std::bad_alloc();
    return real(pool, size);
}

}  // namespace tbb::detail::r1

// Not inlined, or GCC takes the pair for a mismatch.
[[gnu::noinline]] void* operator new(std::size_t size) {
    if (allocations.fetch_add(1) == failing.load()) throw std::bad_alloc();
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
    std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}

namespace bvhlab {
namespace {

/// What a run answers, bit by bit.
std::string bytes_of(const Array<Box>& boxes) {
    std::string bytes(boxes.size() * sizeof(Box), '\0');
    std::memcpy(bytes.data(), boxes.data(), bytes.size());
    return bytes;
}

std::string run_all(const BuilderInfo& builder, const Parameters& parameters,
                    const std::shared_ptr<const Mesh>& mesh) {
    return with_threads(2, [&] {
        Token token;
        BuildLog log;
        const BinaryBvh binary = builder.build(*mesh, {}, parameters, token, log);
        const Bvh bvh = collapse(binary, mesh, 8, {}, token);
        const glm::vec3 origin(-1.0F), direction(1.0F, 1.01F, 0.99F);
        const float near = 0.0F, far = 10.0F;
        trace(bvh, {{&origin, 1}, {&direction, 1}, {&near, 1}, {&far, 1}}, {}, token);
        return bytes_of(binary.boxes);
    });
}

class AllocationFailures : public testing::TestWithParam<BuilderInfo> {};

TEST_P(AllocationFailures, AreBadAllocAndTheNextBuildIsRight) {
    const BuilderInfo& builder = GetParam();
    Parameters parameters = check_parameters(builder, {});
    if (const auto found = parameters.find("iterations"); found != parameters.end())
        found->second = 2.0;
    const auto mesh = test::shared(test::random_soup(6000));  // more than one task
    const std::string expected = run_all(builder, parameters, mesh);
    arm(-1);
    run_all(builder, parameters, mesh);
    const std::int64_t count = allocations;
    ASSERT_GT(count, 5);

    constexpr std::int64_t moments = 16;
    int failed = 0;
    for (std::int64_t i = 0; i < moments; ++i) {
        // The first ones, then evenly over the run.
        const std::int64_t number = i < 8 ? i : (count - 1) * (i - 7) / (moments - 8);
        bool threw = false;
        arm(number);
        try {
            run_all(builder, parameters, mesh);
        } catch (const std::bad_alloc&) {
            threw = true;
        }
        arm(-1);
        failed += threw ? 1 : 0;
        if (i % 5 == 0) {
            ASSERT_EQ(run_all(builder, parameters, mesh), expected) << number;
        }
    }
    EXPECT_GE(failed, moments / 2);  // threads may allocate less than in the run that was counted
    EXPECT_EQ(run_all(builder, parameters, mesh), expected);
}

/// oneTBB waits for ever where a task was counted that could not be made, and leaves other tasks'
/// calls early where one has thrown.
TEST(TaskFailures, AreBadAllocToo) {
    const auto mesh = test::shared(test::random_soup(9000));
    for (const char* id : {"sah", "lbvh", "hlbvh"}) {
        const auto builder = std::ranges::find(builders(), std::string_view(id), &BuilderInfo::id);
        const Parameters parameters = check_parameters(*builder, {});
        run_all(*builder, parameters, mesh);
        arm(-1);
        const std::string expected = run_all(*builder, parameters, mesh);
        const std::int64_t count = tasks;
        ASSERT_GT(count, 10);
        const std::int64_t step = 1 + count / 1500;  // hlbvh has thousands of tasks
        for (std::int64_t number = 0; number < count; number += step) {
            arm(-1, number);
            alarm(100);  // a hang ends the process
            EXPECT_THROW(run_all(*builder, parameters, mesh), std::bad_alloc) << id << number;
            alarm(0);
        }
        arm(-1);
        EXPECT_EQ(run_all(*builder, parameters, mesh), expected) << id;
    }
}

/// What a process of its own, allowed `mebibytes` more than it has, says of a first parallel call.
int first_call_with_room(std::size_t mebibytes) {
    const auto call = [] {
        with_threads(
            2, [] { parallel_for_ranges(0, 1000, 1, [](const IndexRange&) { usleep(10); }); });
    };
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit{pages * 4096 + (mebibytes << 20U), RLIM_INFINITY};
    if (setrlimit(RLIMIT_AS, &limit) != 0) return 10;
    alarm(20);  // a hang ends the process
    for (int i = 0; i < 3; ++i) {
        try {
            call();
            return 11;
        } catch (const std::bad_alloc&) {
        } catch (const std::exception&) {
            return 12;
        }
    }
    limit.rlim_cur = RLIM_INFINITY;
    setrlimit(RLIMIT_AS, &limit);
    call();
    return 0;
}

/// oneTBB throws another error, ends the process or hangs where a worker cannot be started.
TEST(ThreadFailures, AreBadAllocToo) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");  // in a process that has no thread yet
    for (const std::size_t mebibytes : {0U, 3U, 6U, 9U})
        EXPECT_EXIT(std::_Exit(first_call_with_room(mebibytes)), testing::ExitedWithCode(0), "")
            << mebibytes;
}

INSTANTIATE_TEST_SUITE_P(Builders, AllocationFailures, testing::ValuesIn(builders()),
                         [](const auto& tested) { return std::string(tested.param.id); });

}  // namespace
}  // namespace bvhlab
