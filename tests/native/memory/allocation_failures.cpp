// SPDX-License-Identifier: GPL-3.0-or-later
// Memory that cannot be had, at any moment of a build: std::bad_alloc comes out, and the next build
// is right. An executable of its own, as it replaces operator new.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>

#include "../meshes.h"
#include "base/parallel.h"
#include "build/builder.h"
#include "bvh/collapse.h"
#include "trace/trace.h"

namespace {

std::atomic<std::int64_t> allocations{0};  ///< since the last arm()
std::atomic<std::int64_t> failing{-1};     ///< number of the one that fails; -1: none

void arm(std::int64_t number) {
    allocations = 0;
    failing = number;
}

}  // namespace

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

INSTANTIATE_TEST_SUITE_P(Builders, AllocationFailures, testing::ValuesIn(builders()),
                         [](const auto& tested) { return std::string(tested.param.id); });

}  // namespace
}  // namespace bvhlab
