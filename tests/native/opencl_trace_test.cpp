// SPDX-License-Identifier: GPL-3.0-or-later
// Traversal on a device gives the CPU core's hits bit for bit, for every tree and every ray.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "opencl_rays.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

/// All layouts, closest and any hit, counted, and one order of rays each.
void expect_all_agree(const std::shared_ptr<const Mesh>& mesh, const Rays& rays,
                      const std::vector<CostModel>& models = {{3.0, 2.0}}) {
    Token token;
    const BinaryBvh binary = build_lbvh(*mesh, token);
    std::size_t shape = 0;
    for (const std::string& layout : layouts) {
        for (const CostModel& model : models) {
            const Bvh bvh = tree_of(binary, mesh, layout, model);
            const Reorder order = Reorder(1 + shape++ % (reorder_names.size() - 1));
            expect_the_cpus_hits(bvh, rays, {}, layout);
            expect_the_cpus_hits(bvh, rays, {{.any_hit = true}}, layout + ", any hit");
            expect_the_cpus_hits(bvh, rays, {{.count = true}}, layout + ", counted");
            expect_the_cpus_hits(bvh, rays, {{.reorder = order}},
                                 layout + ", " + reorder_names[std::size_t(order)]);
        }
    }
}

// --- hits ---------------------------------------------------------------------------------------

TEST(OpenClTrace, GivesTheHitsOfTheCpu) {
    for (const float size : {0.02F, 0.5F}) {
        const auto mesh = shared(random_soup(3000, size));
        // The second model makes leaves of single references.
        expect_all_agree(mesh, random_rays(5000, mesh->bounds, 3), {{3.0, 2.0}, {1e-3, 1e3}});
    }
}

TEST(OpenClTrace, AgreesOnAwkwardRaysAndMeshes) {
    for (Mesh& mesh : std::vector<Mesh>{sphere(8), copies(40), random_soup(1), random_soup(2),
                                        growing_chain(150, 1.4), sphere(8, glm::vec3(1e6F)),
                                        sphere(8, {}, 1e-20F), sphere(8, {}, 1e-35F),
                                        sphere(8, {}, 1e18F), scaled(random_soup(300), 1e30F)}) {
        const auto held = shared(std::move(mesh));
        expect_all_agree(held, awkward_rays(*held));
        expect_all_agree(held, random_rays(300, held->bounds, 5));
    }
}

TEST(OpenClTrace, DecidesRaysThatAreAimedAtCornersAndEdges) {
    for (Mesh& mesh :
         std::vector<Mesh>{sphere(20), sphere(12, glm::vec3(1e5F)), random_soup(500, 0.3F)}) {
        const auto held = shared(std::move(mesh));
        expect_all_agree(held, aimed_rays(*held, 4000));
    }
}

TEST(OpenClTrace, AgreesWhereRaysBeginOnSurfaces) {
    Token token;
    const auto mesh = shared(sphere(20));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "4");
    Rays rays = random_rays(3000, mesh->bounds, 8);
    const Hits hits = bvhlab::trace(bvh, rays.batch(), {}, token);
    for (std::size_t i = 0; i < rays.origins.size(); ++i)
        if (hits.occluded[i]) rays.origins[i] += hits.t[i] * rays.directions[i];
    expect_the_cpus_hits(bvh, rays, {}, "from surfaces");
    expect_the_cpus_hits(bvh, rays, {{.any_hit = true}}, "from surfaces, any hit");
}

TEST(OpenClTrace, KeepsToTheInterval) {
    Token token;
    const auto mesh = shared(random_soup(500, 0.3F));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "8");
    Rays rays = random_rays(4000, mesh->bounds, 12);
    const Hits hits = bvhlab::trace(bvh, rays.batch(), {}, token);
    rays.t_min.resize(4000);
    rays.t_max.resize(4000);
    for (std::size_t i = 0; i < 4000; ++i) {
        // Exactly at the hit, one step off it, an empty interval.
        const float t = hits.occluded[i] ? hits.t[i] : 1.0F;
        rays.t_min[i] = i % 5 == 0 ? t : i % 5 == 1 ? std::nextafter(t, infinity) : 0.0F;
        rays.t_max[i] = i % 5 == 2   ? t
                        : i % 5 == 3 ? std::nextafter(t, 0.0F)
                        : i % 5 == 4 ? -1.0F
                                     : infinity;
    }
    expect_the_cpus_hits(bvh, rays, {}, "closest");
    expect_the_cpus_hits(bvh, rays, {{.any_hit = true}}, "any hit");
}

TEST(OpenClTrace, DoesNotDependOnTheWorkGroup) {
    Token token;
    const auto mesh = shared(random_soup(1000, 0.2F));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    Rays rays = random_rays(1000, mesh->bounds, 21);
    const Rays aimed = aimed_rays(*mesh, 333);
    for (std::size_t i = 0; i < aimed.origins.size(); ++i)
        rays.add(aimed.origins[i], aimed.directions[i]);
    for (const std::size_t group : {3, 7, 96}) {
        const std::string what = "groups of " + std::to_string(group);
        expect_the_cpus_hits(tree_of(binary, mesh, "4"), rays, {{.reorder = Reorder::aila}, group},
                             what);
        expect_the_cpus_hits(tree_of(binary, mesh, "cwbvh"), rays, {{.any_hit = true}, group},
                             what);
    }
}

TEST(OpenClTrace, NoRaysNoHits) {
    Token token;
    const auto mesh = shared(copies(1));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "2");
    for (const bool any_hit : {false, true}) {
        const Hits hits = trace_on_device(bvh, Rays{}, {{.any_hit = any_hit, .count = true}});
        EXPECT_TRUE(hits.occluded.empty());
        EXPECT_TRUE(hits.triangle.empty());
    }
}

// --- what is asked for and what is not there ----------------------------------------------------

TEST(OpenClTrace, TellsTimesApart) {
    Token token;
    const auto mesh = shared(random_soup(500, 0.1F));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "4");
    const Rays rays = random_rays(5000, mesh->bounds, 2);
    const Hits plain = trace_on_device(bvh, rays, {});
    EXPECT_EQ(plain.key_seconds, 0.0);
    EXPECT_EQ(plain.sort_seconds, 0.0);
    EXPECT_GT(plain.traverse_seconds, 0.0);
    const Hits sorted = trace_on_device(bvh, rays, {{.reorder = Reorder::two_point}});
    EXPECT_GT(sorted.key_seconds, 0.0);
    EXPECT_GT(sorted.sort_seconds, 0.0);
    EXPECT_GT(sorted.traverse_seconds, 0.0);
}

TEST(OpenClTrace, RefusesTestsThatItDoesNotHave) {
    Token token;
    const auto mesh = shared(copies(1));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "2");
    for (const TraceOptions& options :
         {TraceOptions{.triangle_test = TriangleTest::moller_trumbore},
          TraceOptions{.box_test = BoxTest::plain}}) {
        try {
            trace_on_device(bvh, random_rays(1, mesh->bounds, 1), {options});
            FAIL();
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find("use device cpu"), std::string::npos);
        }
    }
}

TEST(OpenClTrace, StopsWhenCancelled) {
    Token token;
    const auto mesh = shared(copies(1));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "2");
    Commands commands(*device(), token);
    const auto tree = upload_tree(commands, bvh);
    token.cancel();
    const Rays rays = random_rays(10, mesh->bounds, 1);
    EXPECT_THROW(trace(commands, bvh, *tree, rays.batch(), {}, token), Cancelled);
}

}  // namespace
}  // namespace bvhlab::opencl
