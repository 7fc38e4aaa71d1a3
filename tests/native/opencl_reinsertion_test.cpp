// SPDX-License-Identifier: GPL-3.0-or-later
// PRBVH with and without annealing on a device against the CPU's, node for node; on PoCL in CI.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <string>
#include <thread>

#include "build/lbvh.h"
#include "build/reinsertion_optimiser.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "opencl/prbvh.h"
#include "opencl/prbvh_a.h"
#include "opencl/reinsertion_optimiser.h"
#include "same_tree.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

constexpr CostModel model;

std::shared_ptr<Device> device() {
    return Device::open("opencl");
}

Mesh changed(Mesh mesh, const std::function<void(glm::vec3&)>& change) {
    std::ranges::for_each(mesh.vertices, change);
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// Triangles one behind the other on the diagonal.
Mesh collinear(std::size_t count) {
    return changed(random_soup(count), [](glm::vec3& v) { v = glm::vec3(v.x); });
}

/// In a plane, with zeros of both signs in all corners of the boxes.
Mesh flat(std::size_t count) {
    std::mt19937 random(3);
    return changed(random_soup(count), [&](glm::vec3& v) {
        v.z = random() % 2 == 0 ? 0.0F : -0.0F;
        if (random() % 4 == 0) v.x = -0.0F;
        if (random() % 4 == 0) v.x = 0.0F;
    });
}

Mesh points(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (glm::uvec3& corners : mesh.triangles) corners.y = corners.z = corners.x;
    return mesh;
}

/// Boxes that are nearly the same: nothing can be pruned, and searches end at their limit of
/// visits.
Mesh nearly_equal(std::size_t count) {
    std::mt19937 random(1);
    Mesh mesh = random_soup(count);
    for (std::size_t i = 0; i < mesh.size(); ++i) {
        mesh.vertices[3 * i] = {-1.0F - uniform(random, 0.0F, 0.01F), -1.0F, -1.0F};
        mesh.vertices[3 * i + 1] = {1.0F, 1.0F + uniform(random, 0.0F, 0.01F), 1.0F};
        mesh.vertices[3 * i + 2] = {0.0F, 0.0F, uniform(random, 0.0F, 1.0F)};
    }
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

BinaryBvh host_base(const Mesh& mesh) {
    Token token;
    return build_lbvh(mesh, token);
}

/// A build on the host or on the device, with its log.
struct Built {
    BinaryBvh bvh;
    BuildLog log;
};

template <class Build>
Built on_host(Build&& build) {
    Token token;
    Built built;
    built.bvh = build(token, built.log);
    return built;
}

template <class Build>
Built on_device(std::size_t work_group, Build&& build) {
    Token token;
    Commands commands(*device(), token);
    if (work_group) commands.work_group = work_group;
    Built built;
    built.bvh = download(commands, build(commands, token, built.log));
    return built;
}

void expect_same(const Built& expected, const Built& built) {
    EXPECT_TRUE(same(expected.bvh, built.bvh));
    EXPECT_STREQ(expected.log.ended, built.log.ended);
    ASSERT_EQ(expected.log.steps.size(), built.log.steps.size());
    for (std::size_t i = 0; i < expected.log.steps.size(); ++i) {
        EXPECT_EQ(expected.log.steps[i].iteration, built.log.steps[i].iteration);
        EXPECT_EQ(expected.log.steps[i].cost, built.log.steps[i].cost) << "step " << i;
    }
}

// --- whole builds -------------------------------------------------------------------------------

Built prbvh_on_device(const Mesh& mesh, const PrbvhConfig& config, std::size_t work_group = 0) {
    return on_device(work_group, [&](Commands& commands, Token& token, BuildLog& log) {
        return build_prbvh(commands, upload(commands, mesh), model, config, token, log);
    });
}

Built prbvh_a_on_device(const Mesh& mesh, const AnnealingConfig& config,
                        std::size_t work_group = 0) {
    return on_device(work_group, [&](Commands& commands, Token& token, BuildLog& log) {
        return build_prbvh_a(commands, upload(commands, mesh), model, config, token, log);
    });
}

void expect_same_prbvh(const Mesh& mesh, const PrbvhConfig& config, std::size_t work_group = 0) {
    const Built expected = on_host([&](Token& token, BuildLog& log) {
        return bvhlab::build_prbvh(mesh, model, config, token, log);
    });
    expect_same(expected, prbvh_on_device(mesh, config, work_group));
}

void expect_same_prbvh_a(const Mesh& mesh, const AnnealingConfig& config,
                         std::size_t work_group = 0) {
    const Built expected = on_host([&](Token& token, BuildLog& log) {
        return bvhlab::build_prbvh_a(mesh, model, config, token, log);
    });
    expect_same(expected, prbvh_a_on_device(mesh, config, work_group));
}

TEST(OpenClReinsertion, PrbvhIsTheHosts) {
    for (const std::size_t count : {1U, 2U, 3U, 4U, 5U, 100U, 7000U})
        expect_same_prbvh(random_soup(count), {});
    expect_same_prbvh(sphere(25), {});
    expect_same_prbvh(random_soup(3000), {.iterations = 6, .sparsity = 5, .lock_rounds = 1});
    expect_same_prbvh(random_soup(300), {.iterations = 0});
}

TEST(OpenClReinsertion, PrbvhIsTheHostsOnHardInputs) {
    const PrbvhConfig config{.iterations = 12};
    expect_same_prbvh(copies(3000), config);
    expect_same_prbvh(collinear(1000), config);
    expect_same_prbvh(flat(2000), config);
    expect_same_prbvh(points(1000), config);
    expect_same_prbvh(growing_chain(3000, 1.03), config);
    expect_same_prbvh(scaled(random_soup(1000), 1e30F), config);
    expect_same_prbvh(scaled(random_soup(1000), 1e-30F), config);
    expect_same_prbvh(nearly_equal(6000), {.iterations = 2});
}

TEST(OpenClReinsertion, PrbvhAIsTheHosts) {
    const AnnealingConfig config{.iterations = 60};
    for (const std::size_t count : {1U, 2U, 3U, 50U, 3000U})
        expect_same_prbvh_a(random_soup(count), config);
    expect_same_prbvh_a(sphere(15), {.iterations = 45, .heated_sparsity = 1, .seed = 9});
}

TEST(OpenClReinsertion, PrbvhAIsTheHostsOnHardInputs) {
    const AnnealingConfig config{.iterations = 32, .heated_sparsity = 3};
    expect_same_prbvh_a(copies(1000), config);
    expect_same_prbvh_a(collinear(500), config);
    expect_same_prbvh_a(flat(1000), config);
    expect_same_prbvh_a(points(500), config);
    expect_same_prbvh_a(growing_chain(1000, 1.05), config);
}

TEST(OpenClReinsertion, SplitBasesAreTheHosts) {
    const Mesh mesh = random_soup(800, 0.5F);
    const SbvhConfig base;
    for (const PrbvhConfig& config : {PrbvhConfig{}, PrbvhConfig{.iterations = 2}})
        expect_same(on_host([&](Token& token, BuildLog& log) {
                        return bvhlab::build_prbvh_s(mesh, model, base, config, token, log);
                    }),
                    on_device(0, [&](Commands& commands, Token& token, BuildLog& log) {
                        return build_prbvh_s(commands, mesh, model, base, config, token, log);
                    }));
    const AnnealingConfig config{.iterations = 40};
    expect_same(on_host([&](Token& token, BuildLog& log) {
                    return bvhlab::build_prbvh_sa(mesh, model, base, config, token, log);
                }),
                on_device(0, [&](Commands& commands, Token& token, BuildLog& log) {
                    return build_prbvh_sa(commands, mesh, model, base, config, token, log);
                }));
}

TEST(OpenClReinsertion, AnyWorkGroupGivesTheSameTree) {
    const Mesh mesh = random_soup(1500, 0.2F);
    for (const std::size_t work_group : {3U, 7U, 96U}) {
        expect_same_prbvh(mesh, {.iterations = 8}, work_group);
        expect_same_prbvh_a(mesh, {.iterations = 32}, work_group);
    }
}

TEST(OpenClReinsertion, TwoBuildsAreEqual) {
    const Mesh mesh = random_soup(8000);
    expect_same(prbvh_on_device(mesh, {.iterations = 8}), prbvh_on_device(mesh, {.iterations = 8}));
    expect_same(prbvh_a_on_device(mesh, {.iterations = 30}),
                prbvh_a_on_device(mesh, {.iterations = 30}));
}

// --- parts --------------------------------------------------------------------------------------

/// A tree nearly as deep as it has leaves: at each level two leaves are split off as a subtree.
BinaryBvh chain_of_pairs(const Mesh& mesh) {
    const auto pairs = std::uint32_t(mesh.size() / 2), first_leaf = 2 * pairs - 1;
    BinaryBvh bvh = BinaryBvh::with_references(2 * pairs);
    for (std::uint32_t i = 0; i < 2 * pairs; ++i) {
        bvh.references[i] = i;
        bvh.boxes[first_leaf + i] = mesh.box(i);
    }
    // Interior nodes: those of the chain, from the root down, then the pairs.
    for (std::uint32_t i = 0; i < pairs; ++i)
        bvh.children[pairs - 1 + i] = {first_leaf + 2 * i, first_leaf + 2 * i + 1};
    for (std::uint32_t i = 0; i + 1 < pairs; ++i)
        bvh.children[i] = {pairs - 1 + i, i + 2 < pairs ? i + 1 : first_leaf - 1};
    for (std::uint32_t i = 0; i < first_leaf; ++i) {
        const std::uint32_t node = i < pairs ? pairs - 1 + i : 2 * pairs - 2 - i;
        bvh.boxes[node] =
            unite(bvh.boxes[bvh.children[node].left], bvh.boxes[bvh.children[node].right]);
    }
    return bvh;
}

struct Step {
    bool heated;
    std::uint32_t sparsity;
};

/// Steps of both optimisers side by side: as many moves, the same costs, the same best tree.
/// Returns the device's times.
Times expect_same_steps(const BinaryBvh& base, std::span<const Step> steps, bool split_keys) {
    Token token;
    Commands commands(*device(), token);
    const Stopwatch clock;
    BuildLog host_log, log;
    const DeviceBinary device_base = upload(commands, base);
    bvhlab::ReinsertionOptimiser host(base, model, clock, token, host_log);
    ReinsertionOptimiser optimiser(commands, device_base, model, clock, token, log, split_keys);
    EXPECT_EQ(host.cost(), optimiser.cost());
    std::uint32_t iteration = 0;
    for (const Step& step : steps) {
        const Heat heat{.temperature = iteration % 2 == 0 ? 0.5F : 1e-4F,
                        .prune_probability = 0.1F,
                        .seed = 5,
                        .iteration = ++iteration};
        const int rounds = 1 + int(iteration % 3);
        if (step.heated) {
            host.heat(heat, step.sparsity, rounds);
            optimiser.heat(heat, step.sparsity, rounds);
        } else {
            EXPECT_EQ(host.climb(iteration, step.sparsity, rounds, 0.01),
                      optimiser.climb(iteration, step.sparsity, rounds, 0.01));
        }
        EXPECT_EQ(host.moved(), optimiser.moved());
        EXPECT_EQ(host.cost(), optimiser.cost());
    }
    EXPECT_TRUE(same(host.best(), download(commands, optimiser.best())));
    return commands.times();
}

bool ran(const Times& times, const std::string& kernel) {
    return std::ranges::any_of(times.kernels,
                               [&](const KernelTime& time) { return time.kernel == kernel; });
}

constexpr Step climbing_and_heating[]{{false, 1}, {false, 1}, {true, 1},  {true, 4}, {false, 1},
                                      {false, 3}, {false, 1}, {false, 1}, {true, 1}, {false, 1}};

TEST(OpenClReinsertion, BothLockPathsMakeTheHostsMoves) {
    for (const Mesh& mesh : {random_soup(2000), random_soup(500, 1.0F), copies(300), flat(500)})
        for (const bool split_keys : {false, true})
            expect_same_steps(host_base(mesh), climbing_and_heating, split_keys);
}

TEST(OpenClReinsertion, DeepTreesAreTheHosts) {
    // Searches need deep stacks, and ways up are as long as the tree.
    EXPECT_TRUE(
        ran(expect_same_steps(chain_of_pairs(random_soup(600, 2.0F)), climbing_and_heating, false),
            "search_deep"));
    EXPECT_FALSE(
        ran(expect_same_steps(host_base(sphere(10)), climbing_and_heating, false), "search_deep"));
}

TEST(OpenClReinsertion, TheBestTreeIsValid) {
    const Mesh mesh = random_soup(5000);
    Token token;
    Commands commands(*device(), token);
    BuildLog log;
    const DeviceBinary bvh = build_prbvh(commands, upload(commands, mesh), model, {}, token, log);
    EXPECT_NO_THROW(validate(download(commands, bvh), mesh));
    EXPECT_STREQ(log.ended, "converged");
    EXPECT_STREQ(token.stage(), "building PRBVH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    EXPECT_DOUBLE_EQ(token.cost(), log.steps.back().cost);
    EXPECT_LT(log.steps.back().cost, 0.9 * log.steps.front().cost);
    for (const char* stage : {"searching", "locking", "moving", "refitting"})
        EXPECT_GT(commands.times().stage_seconds(stage), 0.0) << stage;
}

TEST(OpenClReinsertion, EndsAtTheTimeLimit) {
    const Mesh mesh = random_soup(2000);
    EXPECT_STREQ(prbvh_on_device(mesh, {.max_seconds = 1e-6}).log.ended, "time limit");
    EXPECT_STREQ(prbvh_a_on_device(mesh, {.max_seconds = 1e-6}).log.ended, "time limit");
}

TEST(OpenClReinsertion, StopsWhenCancelled) {
    const Mesh mesh = random_soup(50000);
    Token token;
    Commands commands(*device(), token);
    const DeviceBinary base = upload(commands, host_base(mesh));
    const Stopwatch clock;
    BuildLog log;
    std::thread canceller([&] {
        while (token.cost() != token.cost()) std::this_thread::yield();  // NaN until the first
        token.cancel();
    });
    EXPECT_THROW(climb(commands, base, model, {.threshold = 0.0}, clock, token, log), Cancelled);
    canceller.join();
    EXPECT_LT(log.steps.size(), 5U);
    EXPECT_STREQ(log.ended, "iteration limit");  // set at the start, as on the host

    Token cancelled;
    Commands stopped(*device(), cancelled);
    cancelled.cancel();
    EXPECT_THROW(upload(stopped, mesh), Cancelled);
}

}  // namespace
}  // namespace bvhlab::opencl
