// SPDX-License-Identifier: GPL-3.0-or-later
// Compressed 8-wide nodes: what is stored, and that rays find in them what they find elsewhere.
#include <gtest/gtest.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <hwy/highway.h>
#include <hwy/targets.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "build/sbvh.h"
#include "bvh/collapse.h"
#include "bvh/epo.h"
#include "bvh/leaf_count_variability.h"
#include "bvh/metrics.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "trace/trace.h"

namespace bvhlab {
namespace {

using namespace test;

// --- trees ---------------------------------------------------------------------------------------

Bvh compressed(const std::shared_ptr<const Mesh>& mesh, const CostModel& model = {}) {
    Token token;
    return compress(build_lbvh(*mesh, token), mesh, model, token);
}

const CompressedBvh& tree_of(const Bvh& bvh) {
    return std::get<CompressedBvh>(bvh.tree);
}

TEST(Compress, IsValidOnEveryShapeOfInput) {
    for (Mesh& mesh : std::vector<Mesh>{
             random_soup(1), random_soup(2), random_soup(3), random_soup(5000), copies(20000),
             sphere(12), growing_chain(3000, 1.03), scaled(random_soup(500), 1e-36F),
             scaled(random_soup(500), 1e36F), scaled(random_soup(500), 1e-44F)}) {
        const auto held = shared(std::move(mesh));
        for (const CostModel& model : {CostModel{}, CostModel{1e3, 1e-3}, CostModel{1e-3, 1e3}}) {
            const Bvh bvh = compressed(held, model);
            EXPECT_NO_THROW(validate(bvh));
            EXPECT_EQ(bvh.reference_count, held->size());
            EXPECT_LE(bvh.max_leaf_size, 3U);
        }
    }
}

TEST(Compress, StoresOneTriangleInOneNode) {
    const Bvh bvh = compressed(shared(copies(1)));
    EXPECT_EQ(bvh.branching(), 8U);
    EXPECT_EQ(bvh.layout(), NodeLayout::cwbvh);
    EXPECT_EQ(bvh.node_bytes(), 80U);
    EXPECT_EQ(bvh.leaf_bytes(), 40U + 4 * CompressedBvh::corner_padding);
    EXPECT_EQ(bvh.leaf_count, 1U);
    EXPECT_EQ(std::popcount(unsigned(tree_of(bvh).nodes[0].interior_mask)), 0);
}

/// Intersection so cheap that each node is filled to the brim.
TEST(Compress, TakesTwentyFourTrianglesToANode) {
    const Bvh bvh = compressed(shared(random_soup(32)), {1e6, 1e-6});
    EXPECT_NO_THROW(validate(bvh));
    const auto full = shared(copies(24));
    Token token;
    // A tree whose eight subtrees of three are leaves at best.
    BinaryBvh binary = BinaryBvh::with_references(24);
    std::iota(binary.references.begin(), binary.references.end(), 0U);
    std::ranges::fill(binary.boxes, full->bounds);
    for (std::uint32_t i = 0; i < 7; ++i) binary.children[i] = {2 * i + 1, 2 * i + 2};
    for (std::uint32_t i = 0; i < 8; ++i) {
        binary.children[7 + i] = {15 + i, 23 + 3 * i};
        binary.children[15 + i] = {24 + 3 * i, 25 + 3 * i};
    }
    ASSERT_NO_THROW(validate(binary, *full));
    const Bvh packed = compress(binary, full, {}, token);
    EXPECT_NO_THROW(validate(packed));
    EXPECT_EQ(packed.interior_count(), 1U);
    EXPECT_EQ(packed.leaf_count, 8U);
    EXPECT_EQ(tree_of(packed).nodes[0].meta[7], 0b11100000U | 21U);
}

TEST(Compress, IsTheSameForAnyThreadCount) {
    const auto mesh = shared(random_soup(5000));
    Token token;
    const BinaryBvh binary = build_lbvh(*mesh, token);
    const auto made = [&](int threads) {
        return with_threads(threads, [&] { return compress(binary, mesh, {}, token); });
    };
    const Bvh one = made(1), three = made(3);
    const auto same = [](const auto& a, const auto& b) {
        return a.size() == b.size() &&
               std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
    };
    EXPECT_TRUE(same(tree_of(one).nodes, tree_of(three).nodes));
    EXPECT_TRUE(same(tree_of(one).corners, tree_of(three).corners));
    EXPECT_TRUE(same(tree_of(one).triangles, tree_of(three).triangles));
}

TEST(Compress, StopsWhenCancelled) {
    Token token;
    const auto mesh = shared(random_soup(1000));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    token.cancel();
    EXPECT_THROW(compress(binary, mesh, {}, token), Cancelled);
}

/// On whole coordinates from 0 to 255 the grids are whole too and boxes decode to what they were,
/// so all measures are those of the full layout. Leaves of one triangle, charged alike.
TEST(Compress, MeasuresAreThoseOfFullNodesWhereBoxesAreExact) {
    Mesh rough = random_soup(400, 0.01F);
    for (std::size_t i = 0; i < 3; ++i) {  // the first two span the range
        rough.vertices[i] *= 0.01F;
        rough.vertices[3 + i] = 1.0F - 0.01F * rough.vertices[3 + i];
    }
    rough.vertices[0] = glm::vec3(0.0F);
    rough.vertices[3] = glm::vec3(1.0F);
    for (glm::vec3& vertex : rough.vertices)
        vertex = glm::round(255.0F * glm::clamp(vertex, 0.0F, 1.0F));
    const auto mesh = shared(make_mesh(std::move(rough.vertices), std::move(rough.triangles)));
    Token token;
    const BinaryBvh binary = build_lbvh(*mesh, token);
    const CostModel full_model{1e-6, 1.0}, small_model{1e-6, 8.0};
    const Bvh full = collapse(binary, mesh, 8, full_model, token);
    const Bvh small = compress(binary, mesh, small_model, token);
    ASSERT_EQ(full.max_leaf_size, 1U);
    ASSERT_EQ(small.max_leaf_size, 1U);
    EXPECT_EQ(small.interior_count(), full.interior_count());
    EXPECT_EQ(shape(small).mean_leaf_depth, shape(full).mean_leaf_depth);
    for (const CostModel& model : {CostModel{3.0, 2.0}, CostModel{1.0, 0.0}}) {
        const CostModel each{model.traversal, 8.0 * model.intersection};
        EXPECT_NEAR(cost(small, each), cost(full, model), 1e-9 * cost(full, model));
        const double overlap = end_point_overlap(full, model, token);
        EXPECT_GT(overlap, 0.0);
        EXPECT_NEAR(end_point_overlap(small, each, token), overlap, 1e-9 * overlap);
    }
    const LeafCounts leaves = leaf_count_variability(small, 2000, token);
    const LeafCounts expected = leaf_count_variability(full, 2000, token);
    EXPECT_EQ(leaves.mean, expected.mean);
    EXPECT_EQ(leaves.deviation, expected.deviation);
}

TEST(Compress, CostCountsTrianglesAndDecodedBoxes) {
    EXPECT_DOUBLE_EQ(cost(compressed(shared(copies(1))), {}), 3.0 + 2.0);
    EXPECT_DOUBLE_EQ(cost(compressed(shared(copies(3)), {1e6, 1e-6}), {}), 3.0 + 3 * 2.0);
    // The boxes that were quantised cost more than exact ones.
    Token token;
    const auto mesh = shared(random_soup(3000));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    const Bvh small = compress(binary, mesh, {1e-6, 1.0}, token);  // leaves of one, nearly all
    const CostModel tests{0.0, 1.0};
    EXPECT_GT(cost(small, tests), 0.9 * cost(binary, tests));
    EXPECT_LT(cost(small, tests), 1.3 * cost(binary, tests));
}

TEST(Compress, ValidateFindsEachDefect) {
    const Bvh good = compressed(shared(random_soup(500)));
    ASSERT_NO_THROW(validate(good));
    const auto broken = [&](const char* what, auto change) {
        Bvh bvh = good;
        change(bvh, std::get<CompressedBvh>(bvh.tree));
        EXPECT_THROW(validate(bvh), std::logic_error) << what;
    };
    const auto slot_where = [](const CompressedNode& node, auto is) {
        for (unsigned slot = 0; slot < 8; ++slot)
            if (is(node, slot)) return slot;
        return 8U;
    };
    const auto find = [&](CompressedBvh& tree, auto is) -> std::pair<CompressedNode&, unsigned> {
        for (CompressedNode& node : tree.nodes)
            if (const unsigned slot = slot_where(node, is); slot < 8) return {node, slot};
        throw std::logic_error("no such slot");
    };
    const auto missing = [](const CompressedNode& n, unsigned s) { return n.is_missing(s); };
    const auto leaf = [](const CompressedNode& n, unsigned s) {
        return n.leaf_size(s) && n.is_leaf(s);
    };
    const auto interior = [](const CompressedNode& n, unsigned s) {
        return (n.interior_mask >> s & 1U) != 0;
    };

    broken("depth", [](Bvh& bvh, auto&) { ++bvh.max_depth; });
    broken("references", [](Bvh& bvh, auto&) { ++bvh.reference_count; });
    broken("leaves", [](Bvh& bvh, auto&) { ++bvh.leaf_count; });
    broken("a node lost", [](Bvh&, auto& tree) { tree.nodes.pop_back(); });
    broken("a reference lost", [](Bvh&, auto& tree) { tree.triangles.pop_back(); });
    broken("corners lost", [](Bvh&, auto& tree) { tree.corners.pop_back(); });
    broken("a triangle twice", [](Bvh&, auto& tree) { tree.triangles[0] = tree.triangles[1]; });
    broken("no triangle", [](Bvh&, auto& tree) { tree.triangles[0] = no_triangle; });
    broken("corner moved", [](Bvh&, auto& tree) { tree.corners[4] += 1.0F; });
    broken("origin", [](Bvh&, auto& tree) { tree.nodes[0].origin[1] = std::nanf(""); });
    broken("origin moved", [](Bvh&, auto& tree) { tree.nodes[0].origin[1] += 0.1F; });
    broken("exponent 0", [](Bvh&, auto& tree) { tree.nodes[0].exponent[2] = 0; });
    broken("exponent 255", [](Bvh&, auto& tree) { tree.nodes[0].exponent[2] = 255; });
    broken("exponent less", [](Bvh&, auto& tree) { --tree.nodes[0].exponent[0]; });
    broken("first child", [](Bvh&, auto& tree) { ++tree.nodes[0].first_child; });
    broken("first triangle", [](Bvh&, auto& tree) { ++tree.nodes.back().first_triangle; });
    broken("planes of a leaf", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, leaf);
        node.planes[0][slot] = node.planes[3][slot];
    });
    broken("planes of a node", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, interior);
        node.planes[5][slot] = node.planes[2][slot];
    });
    broken("an interior child not in the mask", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, interior);
        node.interior_mask ^= std::uint8_t(1U << slot);
    });
    broken("a leaf in the mask", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, leaf);
        node.interior_mask |= std::uint8_t(1U << slot);
    });
    broken("another slot's name", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, interior);
        node.meta[slot] ^= 1U;
    });
    broken("a count not unary", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, leaf);
        node.meta[slot] = std::uint8_t(0b010U << 5 | (node.meta[slot] & 31U));
    });
    broken("another offset", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, leaf);
        ++node.meta[slot];
    });
    broken("a leaf no more", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, leaf);
        node.meta[slot] = 0;
    });
    broken("planes of a missing slot", [&](Bvh&, auto& tree) {
        auto [node, slot] = find(tree, missing);
        node.planes[1][slot] = 0;
    });
}

// --- hits ----------------------------------------------------------------------------------------

struct Rays {
    std::vector<glm::vec3> origins, directions;
    float t_min = 0.0F, t_max = std::numeric_limits<float>::infinity();

    RayBatch batch() const { return {origins, directions, {&t_min, 1}, {&t_max, 1}}; }
};

/// Rays through triangles, along axes, from corners, with zero and tiny components.
Rays rays_at(const Mesh& mesh, std::size_t count) {
    std::mt19937 random(7);
    const float parts[] = {0.0F, -0.0F, 1.0F, -1.0F, 1e-42F, -1e-30F, 1e20F};
    const glm::vec3 size = 0.5F * (mesh.bounds.upper - mesh.bounds.lower) + 1e-37F;
    Rays rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Triangle triangle = mesh.triangle(random() % mesh.size());
        const glm::vec3 inside = 0.25F * triangle.a + 0.35F * triangle.b + 0.4F * triangle.c;
        glm::vec3 direction = size * uniform_vector(random, -1.0F, 1.0F);
        if (i % 3 == 0)
            for (int axis = 0; axis < 3; ++axis) direction[axis] = parts[random() % 7];
        if (direction == glm::vec3(0.0F)) direction.x = 1.0F;
        rays.origins.push_back(i % 3 == 0 ? (i % 2 ? triangle.a : inside) : inside - direction);
        rays.directions.push_back(direction);
    }
    return rays;
}

bool same_bits(const Array<float>& a, const Array<float>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

void expect_same_hits(const BinaryBvh& binary, const std::shared_ptr<const Mesh>& mesh,
                      std::size_t ray_count) {
    Token token;
    const Rays rays = rays_at(*mesh, ray_count);
    const Bvh full = collapse(binary, mesh, 8, {}, token);
    const Hits expected = trace(full, rays.batch(), {}, token);
    const auto expect_same = [&](const Hits& hits, const char* what) {
        EXPECT_EQ(hits.triangle, expected.triangle) << what;
        EXPECT_TRUE(same_bits(hits.t, expected.t)) << what;
        EXPECT_TRUE(same_bits(hits.u, expected.u)) << what;
        EXPECT_TRUE(same_bits(hits.v, expected.v)) << what;
    };
    for (const CostModel& model : {CostModel{}, CostModel{10.0, 0.1}}) {
        const Bvh small = compress(binary, mesh, model, token);
        ASSERT_NO_THROW(validate(small));
        expect_same(trace(small, rays.batch(), {.threads = 3}, token), "threads");
        const Hits any = trace(small, rays.batch(), {.any_hit = true}, token);
        EXPECT_EQ(any.occluded, expected.occluded);
    }
    const Bvh small = compress(binary, mesh, {}, token);
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        expect_same(trace(small, rays.batch(), {}, token), hwy::TargetName(target));
        hwy::SetSupportedTargetsForTest(0);
    }
}

TEST(CompressedHits, AreThoseOfFullNodes) {
    Token token;
    for (Mesh& mesh :
         std::vector<Mesh>{random_soup(3000, 0.02F), random_soup(2000, 0.5F), sphere(20),
                           copies(40), growing_chain(500, 1.1), sphere(8, glm::vec3(1e6F)),
                           sphere(8, {}, 1e-20F), sphere(8, {}, 1e18F),
                           scaled(random_soup(400), 1e36F), random_soup(1), random_soup(2)}) {
        const auto held = shared(std::move(mesh));
        expect_same_hits(build_lbvh(*held, token), held, 300);
    }
    // All in one step of the grid: every ray tests every triangle, in denormal numbers.
    const auto tiny = shared(sphere(4, {}, 1e-40F));
    expect_same_hits(build_lbvh(*tiny, token), tiny, 60);
}

TEST(CompressedHits, AreThoseOfFullNodesWhereTrianglesAreSplit) {
    // Long and thin across all axes: spatial splits pay.
    std::mt19937 random(4);
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    for (std::uint32_t i = 0; i < 300; ++i) {
        for (int end = 0; end < 2; ++end) vertices.push_back(uniform_vector(random, 0.0F, 1.0F));
        vertices.push_back(vertices.back() + uniform_vector(random, -0.01F, 0.01F));
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const auto mesh = shared(make_mesh(std::move(vertices), std::move(triangles)));
    Token token;
    const BinaryBvh binary = build_sbvh(*mesh, {}, {}, token);
    ASSERT_GT(binary.reference_count(), mesh->size());
    expect_same_hits(binary, mesh, 600);
}

/// Other tests read the corners, or their transforms, lane by lane: the same triangle gets the same
/// arithmetic in every layout, so away from edges and ties hits are the same.
TEST(CompressedHits, WorkWithEveryTriangleAndBoxTest) {
    Token token;
    const auto mesh = shared(random_soup(2000, 0.2F));
    const BinaryBvh binary = build_lbvh(*mesh, token);
    const Bvh full = collapse(binary, mesh, 8, {}, token),
              small = compress(binary, mesh, {}, token);
    const Rays rays = rays_at(*mesh, 2000);
    for (std::size_t test = 0; test < triangle_test_names.size(); ++test) {
        for (std::size_t box = 0; box < box_test_names.size(); ++box) {
            const TraceOptions options{.triangle_test = TriangleTest(test),
                                       .box_test = BoxTest(box)};
            const Hits a = trace(full, rays.batch(), options, token);
            const Hits b = trace(small, rays.batch(), options, token);
            std::size_t same = 0;
            for (std::size_t i = 0; i < rays.origins.size(); ++i)
                same += a.triangle[i] == b.triangle[i] && a.t[i] == b.t[i] && a.u[i] == b.u[i];
            EXPECT_GE(same, rays.origins.size() * 999 / 1000)
                << triangle_test_names[test] << " " << box_test_names[box];
        }
    }
}

TEST(CompressedHits, AreCounted) {
    Token token;
    const Bvh bvh = compressed(shared(copies(3)));
    Rays rays;
    rays.origins = {{0.2F, 0.2F, 1.0F}, {5.0F, 5.0F, 1.0F}};
    rays.directions = {{0.0F, 0.0F, -1.0F}, {0.0F, 0.0F, -1.0F}};
    const Hits hits = trace(bvh, rays.batch(), {.count = true}, token);
    EXPECT_EQ(hits.node_visits, (Array<std::uint32_t>{1, 1}));
    EXPECT_EQ(hits.box_tests, (Array<std::uint32_t>(2, std::uint32_t(bvh.leaf_count))));
    EXPECT_EQ(hits.triangle_tests, (Array<std::uint32_t>{3, 0}));
    EXPECT_EQ(hits.triangle[0], 0U);
}

}  // namespace
}  // namespace bvhlab
