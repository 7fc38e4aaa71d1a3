// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/prbvh_a.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "base/parallel.h"
#include "build/annealing_choice.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"

namespace bvhlab {
namespace {

using namespace test;

constexpr CostModel model;

BinaryBvh build(const Mesh& mesh, const AnnealingConfig& config) {
    Token token;
    BuildLog log;
    return build_prbvh_a(mesh, model, config, token, log);
}

BinaryBvh climb(const Mesh& mesh) {
    Token token;
    BuildLog log;
    return build_prbvh(mesh, model, {}, token, log);
}

Mesh without_area(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (glm::uvec3& corners : mesh.triangles) corners.y = corners.z = corners.x;
    return mesh;
}

TEST(Annealing, TemperatureFollowsEquation5) {
    const AnnealingConfig config;
    for (int i = 0; i < config.iterations; ++i) {
        const double wave = -std::sin(2.0 * M_PI * i / 50.0) * (3000.0 - i) / 3000.0;
        EXPECT_NEAR(temperature(config, i), std::max(0.0, wave), 1e-9) << i;
    }
    // The first half of each period is exactly cold.
    for (int phase = 0; phase <= 25; ++phase)
        EXPECT_EQ(temperature(config, 2000 + phase), 0.0) << phase;
    for (int phase = 26; phase < 50; ++phase)
        EXPECT_GT(temperature(config, 2000 + phase), 0.0) << phase;
    EXPECT_NEAR(temperature({.max_temperature = 3.0}, 37), 3.0 * 0.998 * 2963 / 3000, 1e-3);
}

TEST(Annealing, AcceptsWithTheProbabilityOfEquation4) {
    // Half areas: a loss of surface area 0.02 at temperature 0.04.
    const Heat heat{.temperature = 0.02F, .prune_probability = 0.01F, .seed = 1, .iteration = 3};
    int accepted = 0, entered = 0, gained = 0;
    constexpr int trials = 100000;
    for (int i = 0; i < trials; ++i) {
        AnnealedReinsertion choice(heat, std::uint32_t(i));
        choice.begin(0.5F);
        choice.offer(-0.01F, 7, 7);
        accepted += choice.accepted.target == 7;
        entered += choice.hopes(0.49F, 1.0F);
        choice.offer(0.001F, 8, 8);
        gained += choice.accepted.target == 8;
    }
    EXPECT_NEAR(double(accepted) / trials, std::exp(-0.5), 0.005);
    EXPECT_NEAR(double(entered) / trials, 0.01, 0.002);
    EXPECT_EQ(gained, trials);
}

TEST(Annealing, PrunesWithTheProbabilityOfEquation4BelowTheLimit) {
    const Heat heat{.temperature = 0.02F, .prune_probability = 0.5F, .seed = 1, .iteration = 3};
    int entered = 0;
    constexpr int trials = 100000;
    for (int i = 0; i < trials; ++i) {
        AnnealedReinsertion choice(heat, std::uint32_t(i));
        choice.begin(0.5F);
        choice.offer(0.02F, 7, 7);  // the best so far, whatever is accepted later
        choice.offer(-0.5F, 8, 8);
        entered += choice.hopes(0.5F - 0.02F, 1.0F);  // at best 0.04 worse
        EXPECT_TRUE(choice.hopes(0.5F + 0.03F, 1.0F));
    }
    EXPECT_NEAR(double(entered) / trials, std::exp(-2.0), 0.005);
}

TEST(Annealing, RandomNumbersAreUniformAndDependOnAllTheirCounters) {
    double sum = 0.0, squares = 0.0;
    constexpr int count = 100000;
    for (int i = 0; i < count; ++i) {
        CounterRandom random(1, 2, std::uint64_t(i));
        random.uniform();
        const double value = random.uniform();
        ASSERT_GE(value, 0.0);
        ASSERT_LT(value, 1.0);
        sum += value;
        squares += value * value;
    }
    EXPECT_NEAR(sum / count, 0.5, 0.005);
    EXPECT_NEAR(squares / count, 1.0 / 3.0, 0.005);
    const float first = CounterRandom(1, 2, 3).uniform();
    EXPECT_EQ(first, CounterRandom(1, 2, 3).uniform());
    EXPECT_NE(first, CounterRandom(2, 2, 3).uniform());
    EXPECT_NE(first, CounterRandom(1, 3, 3).uniform());
    EXPECT_NE(first, CounterRandom(1, 2, 4).uniform());
}

TEST(PrbvhA, CostsNoMoreThanHillClimbing) {
    for (const Mesh& mesh : {random_soup(3000), random_soup(1000, 0.5F), sphere(20)}) {
        const BinaryBvh bvh = build(mesh, {.iterations = 200});
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_LE(cost(bvh, model), 1.005 * cost(climb(mesh), model));
    }
}

TEST(PrbvhA, LeavesLocalMinima) {
    const Mesh mesh = random_soup(1500, 0.3F);
    EXPECT_LT(cost(build(mesh, {.iterations = 600}), model), 0.998 * cost(climb(mesh), model));
}

TEST(PrbvhA, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), random_soup(4),
                             copies(20000), without_area(1000), growing_chain(1000, 1.05),
                             growing_chain(100, 3.0), random_soup(1000, 2.0F)}) {
        for (const double sparsity : {1.0, 16.0}) {
            const BinaryBvh bvh = build(mesh, {.iterations = 60, .heated_sparsity = int(sparsity)});
            EXPECT_NO_THROW(validate(bvh, mesh));
        }
    }
}

TEST(PrbvhA, IsTheSameForAnyThreadCountAndAnotherForAnotherSeed) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    const Mesh mesh = random_soup(4500);
    const AnnealingConfig config{.iterations = 80};
    const BinaryBvh one = with_threads(1, [&] { return build(mesh, config); });
    for (const int threads : {2, 7}) {
        const BinaryBvh many = with_threads(threads, [&] { return build(mesh, config); });
        EXPECT_TRUE(same(one, many));
    }
    EXPECT_NE(one.references, build(mesh, {.iterations = 80, .seed = 2}).references);
}

TEST(PrbvhA, ReturnsTheBestTreeAlsoWhenLimited) {
    const Mesh mesh = random_soup(5000);
    for (const double seconds : {1e-6, 0.3}) {
        Token token;
        BuildLog log;
        const BinaryBvh bvh = build_prbvh_a(mesh, model, {.max_seconds = seconds}, token, log);
        EXPECT_NO_THROW(validate(bvh, mesh));
        EXPECT_STREQ(log.ended, "time limit");
        EXPECT_NEAR(cost(bvh, model), log.steps.back().cost, 1e-3);
        for (const BuildStep& step : log.steps) EXPECT_GE(step.cost, log.steps.back().cost);
    }
    Token token;
    BuildLog log;
    build_prbvh_a(mesh, model, {.iterations = 0}, token, log);
    EXPECT_STREQ(log.ended, "converged");
}

TEST(PrbvhA, SplitBaseIsImproved) {
    const Mesh mesh = random_soup(500, 0.5F);
    Token token;
    BuildLog log;
    const BinaryBvh bvh =
        build_prbvh_sa(mesh, model, {.max_leaf_size = 1}, {.iterations = 60}, token, log);
    EXPECT_GT(bvh.reference_count(), mesh.size());
    EXPECT_NO_THROW(validate(bvh, mesh));
    EXPECT_LT(cost(bvh, model), log.steps.front().cost);
    EXPECT_STREQ(token.stage(), "building PRBVH_SA");
}

TEST(PrbvhA, StopsWhenCancelled) {
    Token token;
    BuildLog log;
    token.cancel();
    EXPECT_THROW(build_prbvh_a(random_soup(1000), model, {}, token, log), Cancelled);
}

}  // namespace
}  // namespace bvhlab
