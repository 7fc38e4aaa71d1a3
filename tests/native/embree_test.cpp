// SPDX-License-Identifier: GPL-3.0-or-later
#ifdef BVHLAB_WITH_EMBREE

#include "reference/embree.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include "meshes.h"
#include "reference/brute_force.h"
#include "reference/embree_library.h"

namespace bvhlab {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

struct Rays {
    std::vector<glm::vec3> origins, directions;
    std::vector<float> t_min = {0.0F}, t_max = {infinity};

    RayBatch batch() const { return {origins, directions, t_min, t_max}; }
};

Rays random_rays(std::size_t count) {
    std::mt19937 random(17);
    Rays rays;
    for (std::size_t i = 0; i < count; ++i) {
        rays.origins.push_back(test::uniform_vector(random, -0.5F, 1.5F));
        rays.directions.push_back(test::uniform_vector(random, -1, 1));
    }
    return rays;
}

template <class Function>
std::string refusal(Function&& function) {
    try {
        function();
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "";
}

/// Tests of Embree itself need one.
class Embree : public testing::Test {
protected:
    void SetUp() override {
        if (!embree_status().available) GTEST_SKIP() << embree_status().reason;
    }
};

TEST(EmbreeVersion, OtherMajorIsRefused) {
    EXPECT_NO_THROW(check_embree_version(31305, 3));
    EXPECT_NO_THROW(check_embree_version(40303, 4));
    EXPECT_EQ(refusal([] { check_embree_version(40400, 3); }),
              "it reports version 4.4.0 where 3 was expected");
    EXPECT_NE(refusal([] { check_embree_version(0, 4); }), "");
    EXPECT_EQ(embree_version_text(31305), "3.13.5");
}

TEST(EmbreeVersion, NotALibraryOrNotEmbree) {
    EXPECT_FALSE(open_embree("libno_such_embree.so.9", 4).has_value());
    EXPECT_EQ(refusal([] { open_embree("libm.so.6", 4); }),
              "libm.so.6 was refused: it lacks the function rtcNewDevice");
}

TEST_F(Embree, WrongMajorIsRefused) {
    for (const auto& [file, wrong] :
         {std::pair("libembree3.so.3", 4), std::pair("libembree4.so.4", 3)}) {
        const std::string text = refusal([file = file, wrong = wrong] {
            if (!open_embree(file, wrong)) throw std::runtime_error("absent");
        });
        EXPECT_TRUE(text == "absent" || text.find("was refused: it reports") != std::string::npos)
            << text;
    }
}

TEST_F(Embree, WrongAnswersAreRefused) {
    for (const auto& [file, major] :
         {std::pair("libembree3.so.3", 3), std::pair("libembree4.so.4", 4)}) {
        std::optional<EmbreeLibrary> library = open_embree(file, major);
        if (!library) continue;
        EXPECT_NO_THROW(check_known_rays(*library));
        // What a clash of versions looks like: every ray misses.
        library->intersect3 = [](embree::Scene, embree::Context3*, embree::RayHit*) {};
        library->intersect4 = [](embree::Scene, embree::RayHit*, void*) {};
        EXPECT_NE(refusal([&] { check_known_rays(*library); }).find("was refused"),
                  std::string::npos);
    }
}

TEST_F(Embree, AgreesWithBruteForce) {
    const Mesh mesh = test::random_soup(2000);
    const Rays rays = random_rays(5000);
    Token token;
    const HitsOf<double> truth = brute_force(mesh, rays.batch(), false, 0, token);
    for (const EmbreeQuality quality :
         {EmbreeQuality::low, EmbreeQuality::medium, EmbreeQuality::high}) {
        for (const bool robust : {false, true}) {
            const EmbreeScene scene(mesh, quality, robust, 0);
            EXPECT_GT(scene.build_seconds(), 0.0);
            const Hits hits = scene.trace(rays.batch(), false, 0, token);
            const Hits any = scene.trace(rays.batch(), true, 0, token);
            EXPECT_TRUE(any.t.empty());
            std::size_t different = 0;
            std::size_t hit_count = 0;
            for (std::size_t i = 0; i < rays.origins.size(); ++i) {
                hit_count += truth.occluded[i];
                EXPECT_EQ(hits.occluded[i] != 0, hits.triangle[i] != no_triangle);
                different +=
                    hits.triangle[i] != truth.triangle[i] || any.occluded[i] != truth.occluded[i];
                if (hits.triangle[i] != truth.triangle[i] || !truth.occluded[i]) continue;
                EXPECT_NEAR(hits.t[i], truth.t[i], 1e-3 * truth.t[i] + 1e-5);
                EXPECT_NEAR(hits.u[i], truth.u[i], 2e-2);
                EXPECT_NEAR(hits.v[i], truth.v[i], 2e-2);
            }
            EXPECT_GT(hit_count, 1000U);
            // Rays within float rounding of an edge may go either way; there are a few in 5000 at
            // most.
            EXPECT_LE(different, 3U);
        }
    }
}

TEST_F(Embree, IntervalsAreTheRays) {
    const Mesh mesh = test::copies(1);
    Rays rays;
    for (int i = 0; i < 4; ++i) {
        rays.origins.push_back({0.25F, 0.25F, -2});
        rays.directions.push_back({0, 0, 1});
    }
    rays.t_min = {0.0F, 0.0F, 2.5F, 3.0F};
    rays.t_max = {infinity, 1.5F, infinity, 1.0F};
    Token token;
    const EmbreeScene scene(mesh, EmbreeQuality::medium, true, 0);
    const Hits hits = scene.trace(rays.batch(), false, 0, token);
    const Hits any = scene.trace(rays.batch(), true, 0, token);
    const std::vector<std::uint8_t> expected = {1, 0, 0, 0};
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(hits.occluded[i], expected[i]) << i;
        EXPECT_EQ(any.occluded[i], expected[i]) << i;
        EXPECT_FLOAT_EQ(hits.t[i], expected[i] ? 2.0F : infinity);
    }
}

TEST_F(Embree, LeavesTheProcessAsItWas) {
    using tbb::global_control;
    const auto limit = [] {
        return global_control::active_value(global_control::max_allowed_parallelism);
    };
    const std::size_t before = limit();
#ifdef __SSE__
    const unsigned mode = _mm_getcsr() & 0x8040U;
#endif
    const EmbreeScene scene(test::random_soup(1000), EmbreeQuality::medium, true, 1);
    EXPECT_EQ(limit(), before);
    Token token;
    scene.trace(random_rays(3000).batch(), false, 1, token);
#ifdef __SSE__
    EXPECT_EQ(_mm_getcsr() & 0x8040U, mode);
#endif
}

TEST_F(Embree, CancelIsHeard) {
    const EmbreeScene scene(test::copies(1), EmbreeQuality::low, false, 0);
    Token token;
    token.cancel();
    EXPECT_THROW(scene.trace(random_rays(10).batch(), false, 0, token), Cancelled);
}

}  // namespace
}  // namespace bvhlab

#endif
