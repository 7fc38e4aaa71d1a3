// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/trace.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <hwy/targets.h>
#include <glm/geometric.hpp>

#include <cstring>
#include <limits>
#include <vector>

#include "build/lbvh.h"
#include "bvh/collapse.h"
#include "rays.h"
#include "reference/brute_force.h"
#include "trace/intersect.h"

namespace bvhlab {
namespace {

using namespace test;

bool same_bits(const Array<float>& a, const Array<float>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

void expect_same(const Hits& a, const Hits& b, const std::string& what) {
    EXPECT_EQ(a.triangle, b.triangle) << what;
    EXPECT_EQ(a.occluded, b.occluded) << what;
    EXPECT_TRUE(same_bits(a.t, b.t)) << what;
    EXPECT_TRUE(same_bits(a.u, b.u)) << what;
    EXPECT_TRUE(same_bits(a.v, b.v)) << what;
}

/// All widths, reordering, threads and SIMD targets against the binary tree in ray order.
void expect_one_answer(std::shared_ptr<const Mesh> mesh, const Rays& rays) {
    Token token;
    const BinaryBvh binary = build_lbvh(*mesh, token);
    const Bvh first = collapse(binary, mesh, 2, {}, token);
    const Hits expected = trace(first, rays.batch(), {}, token);
    std::size_t shape = 0;
    for (const unsigned k : {2U, 4U, 8U}) {
        // A second shape of tree: leaves of single references.
        for (const CostModel& model : {CostModel{3.0, 2.0}, CostModel{1e-3, 1e3}}) {
            const Bvh bvh = collapse(binary, mesh, k, model, token);
            // Every order of rays comes in turn.
            const Reorder order = Reorder(1 + shape++ % (reorder_names.size() - 1));
            for (const Reorder reorder : {Reorder::off, order})
                expect_same(expected,
                            trace(bvh, rays.batch(), {.reorder = reorder, .threads = 3}, token),
                            "k " + std::to_string(k) + ", " + reorder_names[int(reorder)]);
            const Hits any = trace(bvh, rays.batch(), {.any_hit = true}, token);
            EXPECT_EQ(any.occluded, expected.occluded) << "any hit, k " << k;
            EXPECT_TRUE(any.t.empty());
            for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
                hwy::SetSupportedTargetsForTest(target);
                expect_same(expected, trace(bvh, rays.batch(), {}, token), hwy::TargetName(target));
                hwy::SetSupportedTargetsForTest(0);
            }
        }
    }
}

TEST(Trace, AllVariantsGiveTheSameHits) {
    for (const float size : {0.02F, 0.5F}) {
        const auto mesh = shared(random_soup(3000, size));
        expect_one_answer(mesh, random_rays(5000, mesh->bounds, 3));
    }
}

TEST(Trace, AllVariantsAgreeOnAwkwardRaysAndMeshes) {
    for (Mesh& mesh : std::vector<Mesh>{sphere(8), copies(60), growing_chain(150, 1.4),
                                        sphere(8, glm::vec3(1e6F)), sphere(8, {}, 1e-20F),
                                        sphere(8, {}, 1e18F)}) {
        const auto held = shared(std::move(mesh));
        expect_one_answer(held, awkward_rays(*held));
        expect_one_answer(held, random_rays(300, held->bounds, 5));
    }
}

TEST(Trace, AgreesWithBruteForceInDouble) {
    Token token;
    const auto mesh = shared(random_soup(2000, 0.2F));
    const Rays rays = random_rays(5000, mesh->bounds, 11);
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 8, {}, token);
    const Hits hits = trace(bvh, rays.batch(), {}, token);
    const HitsOf<double> judge = brute_force(*mesh, rays.batch(), false, 0, token);
    EXPECT_EQ(hits.triangle, judge.triangle);
    for (std::size_t i = 0; i < rays.origins.size(); ++i) {
        if (!hits.occluded[i]) continue;
        EXPECT_NEAR(hits.t[i], judge.t[i], 1e-6 * std::abs(judge.t[i]));
        EXPECT_NEAR(hits.u[i], judge.u[i], 1e-6);
        EXPECT_NEAR(hits.v[i], judge.v[i], 1e-6);
    }
}

TEST(Trace, NoRayLeavesAClosedSphere) {
    Token token;
    for (const glm::vec3 centre : {glm::vec3(0.0F), glm::vec3(1e5F)}) {
        const auto mesh = shared(sphere(60, centre));
        const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 8, {}, token);
        Rays rays;
        std::mt19937 random(2);
        for (int i = 0; i < 20000; ++i) rays.add(centre, uniform_vector(random, -1.0F, 1.0F));
        for (const glm::vec3& vertex : mesh->vertices) rays.add(centre, vertex - centre);
        for (const glm::uvec3& t : mesh->triangles)
            rays.add(centre, 0.5F * (mesh->vertices[t.x] + mesh->vertices[t.y]) - centre);
        const Hits hits = trace(bvh, rays.batch(), {}, token);
        EXPECT_EQ(std::ranges::count(hits.occluded, 0), 0);
    }
}

TEST(Trace, TiesGoToTheLowerTriangle) {
    Token token;
    const auto mesh = shared(copies(100));
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 4, {}, token);
    Rays rays;
    rays.add({0.2F, 0.2F, 1.0F}, {0.0F, 0.0F, -1.0F});
    const Hits hits = trace(bvh, rays.batch(), {}, token);
    EXPECT_EQ(hits.triangle[0], 0U);
    EXPECT_EQ(hits.t[0], 1.0F);
}

TEST(Trace, DecidesOnTheDirectionAsGiven) {
    // The ray runs in the triangle's plane along one edge. Scaled, its y component would vanish and
    // it would no longer.
    Token token;
    const glm::vec3 far_corner(1.0F, 1e-30F, 1e18F);
    const auto mesh = shared(make_mesh({{0, 0, 0}, {0, 0, 1}, far_corner}, {{0, 1, 2}}));
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 2, {}, token);
    Rays rays;
    rays.add({0, 0, 0}, far_corner);
    EXPECT_EQ(trace(bvh, rays.batch(), {}, token).occluded[0], 0);
}

TEST(Trace, KeepsToTheInterval) {
    Token token;
    const auto mesh = shared(copies(1));
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 2, {}, token);
    const auto hits_between = [&](float t_min, float t_max) {
        Rays rays;
        rays.add({0.2F, 0.2F, 2.0F}, {0.0F, 0.0F, -4.0F});  // meets the triangle at t = 0.5
        rays.t_min = {t_min};
        rays.t_max = {t_max};
        return trace(bvh, rays.batch(), {}, token).occluded[0] == 1;
    };
    EXPECT_TRUE(hits_between(0.0F, infinity));
    EXPECT_TRUE(hits_between(0.5F, 0.5F));
    EXPECT_FALSE(hits_between(0.0F, std::nextafter(0.5F, 0.0F)));
    EXPECT_FALSE(hits_between(std::nextafter(0.5F, 1.0F), infinity));
    EXPECT_FALSE(hits_between(1.0F, 0.0F));
    EXPECT_FALSE(hits_between(0.0F, -1.0F));
}

TEST(Trace, CountsWork) {
    Token token;
    const auto mesh = shared(copies(1));
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 2, {}, token);
    Rays rays;
    rays.add({0.2F, 0.2F, 1.0F}, {0.0F, 0.0F, -1.0F});
    rays.add({5.0F, 5.0F, 1.0F}, {0.0F, 0.0F, -1.0F});
    const Hits hits = trace(bvh, rays.batch(), {.count = true}, token);
    EXPECT_EQ(hits.node_visits, (Array<std::uint32_t>{1, 1}));
    EXPECT_EQ(hits.box_tests, (Array<std::uint32_t>{1, 1}));  // the root has one child
    EXPECT_EQ(hits.triangle_tests, (Array<std::uint32_t>{1, 0}));
}

TEST(Trace, StopsWhenCancelled) {
    Token token;
    const auto mesh = shared(copies(1));
    const Bvh bvh = collapse(build_lbvh(*mesh, token), mesh, 2, {}, token);
    token.cancel();
    Rays rays;
    rays.add({0, 0, 1}, {0, 0, -1});
    EXPECT_THROW(trace(bvh, rays.batch(), {}, token), Cancelled);
}

}  // namespace
}  // namespace bvhlab
