// SPDX-License-Identifier: GPL-3.0-or-later
// Traversal on a device gives the CPU core's hits bit for bit, for every tree and every ray.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "build/lbvh.h"
#include "bvh/collapse.h"
#include "opencl/trace.h"
#include "rays.h"
#include "trace/trace.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

std::shared_ptr<Device> device() {
    return Device::open("opencl");
}

/// Rays at corners and points of edges, from near and far: double decides next to none of them.
Rays aimed_rays(const Mesh& mesh, std::size_t count) {
    std::mt19937 random(17);
    Rays rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Triangle triangle = mesh.triangle(random() % mesh.size());
        const glm::vec3 target = i % 2 ? triangle.a : triangle.a + 0.5F * (triangle.b - triangle.a);
        const float away = i % 3 ? 2.0F : 1e4F;
        const glm::vec3 origin = target + uniform_vector(random, -away, away);
        rays.add(origin, target - origin);
    }
    return rays;
}

// --- comparison ---------------------------------------------------------------------------------

bool same_bits(const Array<float>& a, const Array<float>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

void expect_same(const Hits& expected, const Hits& hits, const std::string& what) {
    EXPECT_EQ(expected.triangle, hits.triangle) << what;
    EXPECT_EQ(expected.occluded, hits.occluded) << what;
    EXPECT_TRUE(same_bits(expected.t, hits.t)) << what;
    EXPECT_TRUE(same_bits(expected.u, hits.u)) << what;
    EXPECT_TRUE(same_bits(expected.v, hits.v)) << what;
    EXPECT_EQ(expected.node_visits, hits.node_visits) << what;
    EXPECT_EQ(expected.box_tests, hits.box_tests) << what;
    EXPECT_EQ(expected.triangle_tests, hits.triangle_tests) << what;
}

/// What to trace a tree with.
struct Variant {
    TraceOptions options;
    std::size_t work_group = 0;  ///< 0: the device's own
    TraceShape shape = TraceShape::automatic;
    bool suits_gpu = false;  ///< kernels as GPUs have them, whatever the device is
    bool sub_groups = true;  ///< where the device has them
};

ShapedHits trace_on_device(const Bvh& bvh, const Rays& rays, const Variant& variant) {
    Token token;
    Commands commands(*device(), token);
    if (variant.work_group) commands.work_group = variant.work_group;
    if (variant.suits_gpu) commands.suits_gpu = true;
    if (!variant.sub_groups) commands.use_sub_groups = false;
    const auto tree = upload_tree(commands, bvh);
    return trace(commands, bvh, *tree, rays.batch(), variant.options, token, variant.shape);
}

const std::vector<std::string> layouts{"2", "4", "8", "cwbvh"};

Bvh tree_of(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, const std::string& layout,
            const CostModel& model = {}) {
    Token token;
    if (layout == "cwbvh") return compress(binary, std::move(mesh), model, token);
    return collapse(binary, std::move(mesh), unsigned(std::stoi(layout)), model, token);
}

/// The CPU's answer and the device's, with the same options; with and without sub-groups, where the
/// device has them and the shape has threads that talk to each other.
void expect_the_cpus_hits(const Bvh& bvh, const Rays& rays, Variant variant,
                          const std::string& what) {
    Token token;
    const Hits expected = bvhlab::trace(bvh, rays.batch(), variant.options, token);
    expect_same(expected, trace_on_device(bvh, rays, variant), what);
    const bool talks =
        variant.shape == TraceShape::persistent || variant.shape == TraceShape::lanes;
    if (!talks || !device()->info().sub_groups.usable) return;
    variant.sub_groups = false;
    expect_same(expected, trace_on_device(bvh, rays, variant), what + ", without sub-groups");
}

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
        expect_all_agree(held, awkward_rays(*held, 2));
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

// --- shapes
// ---------------------------------------------------------------------------------------

/// The shape that a tree's kind has beside `single`.
TraceShape other_shape(const std::string& layout) {
    if (layout == "2") return TraceShape::persistent;
    return layout == "cwbvh" ? TraceShape::octant : TraceShape::lanes;
}

TEST(OpenClTrace, AllShapesGiveTheSameHits) {
    Token token;
    for (Mesh& mesh : std::vector<Mesh>{random_soup(2000, 0.1F), sphere(12), copies(20)}) {
        const auto held = shared(std::move(mesh));
        const BinaryBvh binary = build_lbvh(*held, token);
        for (const std::string& layout : layouts) {
            const Bvh bvh = tree_of(binary, held, layout);
            const TraceShape shape = other_shape(layout);
            for (const Rays& rays : {random_rays(3000, held->bounds, 33), awkward_rays(*held, 2),
                                     aimed_rays(*held, 500)}) {
                for (const bool any_hit : {false, true})
                    expect_the_cpus_hits(bvh, rays, {{.any_hit = any_hit}, 0, shape}, layout);
                expect_the_cpus_hits(bvh, rays, {{.reorder = Reorder::aila}, 0, shape}, layout);
            }
        }
    }
}

TEST(OpenClTrace, OtherShapesDoNotDependOnTheWorkGroup) {
    Token token;
    const auto mesh = shared(random_soup(1000, 0.2F));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    const Rays rays = random_rays(1000, mesh->bounds, 21);
    for (const std::string layout : {"2", "cwbvh"})
        expect_the_cpus_hits(tree_of(binary, mesh, layout), rays, {{}, 7, other_shape(layout)},
                             layout);
}

/// Whether the kernel of a shape talks by sub-groups, with the given group.
bool has_sub_groups(const Bvh& bvh, TraceShape shape, std::size_t group, bool wanted) {
    Token token;
    Commands commands(*device(), token);
    if (group) commands.work_group = group;
    commands.use_sub_groups = wanted;
    return kernel_of(commands, *upload_tree(commands, bvh), shape, false).source.sub_groups;
}

TEST(OpenClTrace, ThreadsTalkBySubGroupsWhereTheDeviceHasThem) {
    const SubGroups& sub_groups = device()->info().sub_groups;
    if (!sub_groups.usable) GTEST_SKIP() << "no sub-groups: " << sub_groups.reason;
    Token token;
    const auto mesh = shared(random_soup(100));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    for (const std::string layout : {"2", "4", "8"}) {
        const Bvh bvh = tree_of(binary, mesh, layout);
        EXPECT_FALSE(has_sub_groups(bvh, other_shape(layout), 0, false)) << layout;
        EXPECT_FALSE(has_sub_groups(bvh, TraceShape::single, 0, true)) << layout;
        // Teams must fit into sub-groups, whose size is the driver's affair.
        if (layout == "2" || !device()->info().is_gpu) {
            EXPECT_TRUE(has_sub_groups(bvh, other_shape(layout), 0, true)) << layout;
        }
    }
}

TEST(OpenClTrace, KernelsForGpusGiveTheSameHits) {
    Token token;
    const auto mesh = shared(random_soup(1000, 0.2F));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    Rays rays = random_rays(1000, mesh->bounds, 27);
    const Rays aimed = aimed_rays(*mesh, 100);
    for (std::size_t i = 0; i < aimed.origins.size(); ++i)
        rays.add(aimed.origins[i], aimed.directions[i]);
    for (const std::string& layout : layouts) {
        const Bvh bvh = tree_of(binary, mesh, layout);
        for (const TraceShape shape : {TraceShape::single, other_shape(layout)})
            expect_the_cpus_hits(bvh, rays, {{}, 0, shape, true},
                                 layout + ", " + trace_shape_names[std::size_t(shape)]);
    }
}

TEST(OpenClTrace, SaysWhichShapeItTook) {
    Token token;
    const auto mesh = shared(random_soup(500, 0.1F));
    const Bvh bvh = tree_of(build_lbvh(*mesh, token), mesh, "cwbvh");
    const Rays many = random_rays(20000, mesh->bounds, 2);
    if (!device()->info().is_gpu) {
        EXPECT_EQ(trace_on_device(bvh, many, {}).shape, TraceShape::single);
    }
    const ShapedHits first = trace_on_device(bvh, many, {{}, 0, TraceShape::measured});
    EXPECT_TRUE(first.shape == TraceShape::single || first.shape == TraceShape::octant);
    // It is kept, and choosing it is not part of the time.
    const ShapedHits second = trace_on_device(bvh, many, {{}, 0, TraceShape::measured});
    EXPECT_EQ(second.shape, first.shape);
    expect_the_cpus_hits(bvh, many, {{}, 0, TraceShape::measured}, "measured");
    EXPECT_THROW(trace_on_device(bvh, many, {{}, 0, TraceShape::lanes}), std::invalid_argument);
}

// --- stacks -------------------------------------------------------------------------------------

/// Triangles one behind the other, and a tree whose every node has the farthest of them as a leaf
/// and the others as its other child: rays along z leave one entry on the stack at each level.
struct DeepTree {
    std::shared_ptr<const Mesh> mesh;
    BinaryBvh binary;

    explicit DeepTree(std::uint32_t depth) : binary(BinaryBvh::with_references(depth + 1)) {
        Array<glm::vec3> vertices;
        Array<glm::uvec3> triangles;
        const std::uint32_t count = depth + 1;
        for (std::uint32_t i = 0; i < count; ++i) {
            const float z = float(i);
            vertices.insert(vertices.end(), {{0, 0, z}, {1, 0, z}, {0, 1, z}});
            triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
        }
        mesh = shared(make_mesh(std::move(vertices), std::move(triangles)));
        for (std::uint32_t i = 0; i < count; ++i) {
            binary.references[i] = i;
            binary.boxes[depth + i] = mesh->box(i);
        }
        for (std::uint32_t node = 0; node < depth; ++node) {
            const std::uint32_t last = depth - node;  // its farthest triangle
            binary.children[node] = {node + 1 < depth ? node + 1 : depth, depth + last};
            binary.boxes[node] = unite(mesh->box(0), mesh->box(last));
        }
    }
};

TEST(OpenClTrace, NoTreeIsTooDeep) {
    const DeepTree deep(3000);
    Rays rays;
    rays.add({0.2F, 0.2F, -1.0F}, {0, 0, 1});  // meets all, the first of them first
    rays.add({0.7F, 0.7F, -1.0F}, {0, 0, 1});  // enters all boxes, meets nothing
    rays.add({0.2F, 0.2F, 4000.0F}, {0, 0, -1});
    rays.add({0.5F, 0.5F, -1.0F}, {0, 0, 1});  // along edges
    for (const std::string& layout : layouts) {
        // Leaves of single references.
        const Bvh bvh = tree_of(deep.binary, deep.mesh, layout, {1e-3, 1e3});
        EXPECT_GE(bvh.max_depth, layout == "2" ? 3000U : 400U);
        expect_the_cpus_hits(bvh, rays, {}, layout);
        expect_the_cpus_hits(bvh, rays, {{.any_hit = true}}, layout + ", any hit");
        expect_the_cpus_hits(bvh, rays, {{.count = true}}, layout + ", counted");
        expect_the_cpus_hits(bvh, rays, {{}, 0, other_shape(layout)}, layout + ", other shape");
    }
}

TEST(OpenClTrace, LanesGoOnWhereLocalMemoryIsFull) {
    const DeepTree deep(3000);
    Rays rays;
    rays.add({0.2F, 0.2F, -1.0F}, {0, 0, 1});
    rays.add({0.2F, 0.2F, 4000.0F}, {0, 0, -1});
    for (const std::string layout : {"4", "8"}) {
        Token token;
        Commands commands(*device(), token);
        const Bvh bvh = tree_of(deep.binary, deep.mesh, layout, {1e-3, 1e3});
        const auto tree = upload_tree(commands, bvh);
        const Hits hits = trace(commands, bvh, *tree, rays.batch(), {}, token, TraceShape::lanes);
        expect_same(bvhlab::trace(bvh, rays.batch(), {}, token), hits, layout);
        for (const KernelTime& time : commands.times().kernels)
            EXPECT_NE(time.kernel, "traverse_carefully") << layout << ", traced again";
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
