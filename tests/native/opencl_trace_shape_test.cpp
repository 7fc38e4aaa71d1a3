// SPDX-License-Identifier: GPL-3.0-or-later
// Every shape of the traversal kernels, with stacks of any depth, gives the CPU core's hits.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "opencl/trace_shape.h"
#include "opencl_rays.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

/// The shape that a tree's kind has beside `single`.
TraceShape other_shape(const std::string& layout) {
    if (layout == "2") return TraceShape::persistent;
    return layout == "cwbvh" ? TraceShape::octant : TraceShape::lanes;
}

TEST(OpenClTraceShape, AllShapesGiveTheSameHits) {
    Token token;
    for (Mesh& mesh : std::vector<Mesh>{random_soup(2000, 0.1F), sphere(12), copies(20)}) {
        const auto held = shared(std::move(mesh));
        const BinaryBvh binary = build_lbvh(*held, token);
        for (const std::string& layout : layouts) {
            const Bvh bvh = tree_of(binary, held, layout);
            const TraceShape shape = other_shape(layout);
            for (const Rays& rays : {random_rays(3000, held->bounds, 33), awkward_rays(*held),
                                     aimed_rays(*held, 500)}) {
                for (const bool any_hit : {false, true})
                    expect_the_cpus_hits(bvh, rays, {{.any_hit = any_hit}, 0, shape}, layout);
                expect_the_cpus_hits(bvh, rays, {{.reorder = Reorder::aila}, 0, shape}, layout);
            }
        }
    }
}

TEST(OpenClTraceShape, OtherShapesDoNotDependOnTheWorkGroup) {
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

TEST(OpenClTraceShape, ThreadsTalkBySubGroupsWhereTheDeviceHasThem) {
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

TEST(OpenClTraceShape, KernelsForGpusGiveTheSameHits) {
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

TEST(OpenClTraceShape, SaysWhichShapeItTook) {
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

TEST(OpenClTraceShape, NoTreeIsTooDeep) {
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

TEST(OpenClTraceShape, LanesGoOnWhereLocalMemoryIsFull) {
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

}  // namespace
}  // namespace bvhlab::opencl
