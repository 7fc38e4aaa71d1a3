// SPDX-License-Identifier: GPL-3.0-or-later
// Collapse and layout on a device give the bytes of the CPU's; on PoCL in CI.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "build/builder.h"
#include "bvh/collapse.h"
#include "meshes.h"
#include "opencl/collapse.h"
#include "same_tree.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

using Shapes = std::vector<std::string>;
const Shapes shapes{"2", "4", "8", "cwbvh"};

template <unsigned K>
void expect_same_tree(const WideBvh<K>& a, const WideBvh<K>& b) {
    EXPECT_TRUE(same_bits(a.nodes, b.nodes));
    EXPECT_TRUE(same_bits(a.blocks, b.blocks));
}

void expect_same_tree(const CompressedBvh& a, const CompressedBvh& b) {
    EXPECT_TRUE(same_bits(a.nodes, b.nodes));
    EXPECT_TRUE(same_bits(a.corners, b.corners));
    EXPECT_TRUE(same_bits(a.triangles, b.triangles));
}

void expect_same(const Bvh& a, const Bvh& b) {
    EXPECT_EQ(a.mesh, b.mesh);
    EXPECT_EQ(a.reference_count, b.reference_count);
    EXPECT_EQ(a.leaf_count, b.leaf_count);
    EXPECT_EQ(a.max_leaf_size, b.max_leaf_size);
    EXPECT_EQ(a.max_depth, b.max_depth);
    ASSERT_EQ(a.tree.index(), b.tree.index());
    std::visit(
        [&](const auto& tree) {
            expect_same_tree(tree, std::get<std::decay_t<decltype(tree)>>(b.tree));
        },
        a.tree);
}

Bvh on_host(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, const std::string& shape,
            const CostModel& model) {
    Token token;
    if (shape == "cwbvh") return bvhlab::compress(binary, mesh, model, token);
    return bvhlab::collapse(binary, mesh, unsigned(std::stoi(shape)), model, token);
}

/// A device with groups of `work_group` work-items; 0: as many as it likes.
struct OnDevice {
    std::size_t work_group = 0;

    Bvh operator()(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh,
                   const std::string& shape, const CostModel& model) const {
        Token token;
        Commands commands(*Device::open("opencl"), token);
        if (work_group) commands.work_group = work_group;
        const DeviceBinary tree = upload(commands, binary);
        const DeviceMesh copy = upload(commands, *mesh);
        if (shape == "cwbvh") return compress(commands, tree, mesh, copy, model, token);
        return collapse(commands, tree, mesh, copy, unsigned(std::stoi(shape)), model, token);
    }
};

void expect_the_hosts_bytes(const BinaryBvh& binary, const std::shared_ptr<const Mesh>& mesh,
                            const CostModel& model = {}, const OnDevice& device = {},
                            const Shapes& some = shapes) {
    for (const std::string& shape : some) {
        SCOPED_TRACE("shape " + shape);
        expect_same(device(binary, mesh, shape, model), on_host(binary, mesh, shape, model));
    }
}

BinaryBvh built(std::string_view id, const Mesh& mesh) {
    const BuilderInfo& builder = find_builder(id);
    Parameters given;
    for (const ParameterInfo& parameter : builder.parameters)
        if (parameter.name == "iterations") given["iterations"] = std::max(parameter.minimum, 3.0);
    Token token;
    BuildLog log;
    return builder.build(mesh, {}, check_parameters(builder, given), token, log);
}

BinaryBvh lbvh(const Mesh& mesh) {
    return built("lbvh", mesh);
}

/// Sets the box of every interior node. Children have higher numbers than their parents.
void fit_boxes(BinaryBvh& binary, const Mesh& mesh) {
    const std::uint32_t leaves = binary.first_leaf();
    for (std::uint32_t i = 0; i <= leaves; ++i)
        binary.boxes[leaves + i] = mesh.box(binary.references[i]);
    for (std::uint32_t i = leaves; i-- > 0;)
        binary.boxes[i] =
            unite(binary.boxes[binary.children[i].left], binary.boxes[binary.children[i].right]);
}

/// A chain as deep as it is long, the rest of it now on the right, now on the left.
BinaryBvh chain(const Mesh& mesh) {
    const auto n = std::uint32_t(mesh.size());
    BinaryBvh binary = BinaryBvh::with_references(n);
    std::iota(binary.references.begin(), binary.references.end(), 0U);
    for (std::uint32_t i = 0; i + 1 < n; ++i) {
        const std::uint32_t leaf = n - 1 + i, rest = i + 2 < n ? i + 1 : 2 * n - 2;
        binary.children[i].left = i % 3 ? leaf : rest;
        binary.children[i].right = i % 3 ? rest : leaf;
    }
    fit_boxes(binary, mesh);
    return binary;
}

/// A chain of balanced trees of 16 triangles each.
BinaryBvh feathered_chain(const Mesh& mesh) {
    const auto n = std::uint32_t(mesh.size());
    BinaryBvh binary = BinaryBvh::with_references(n);
    std::iota(binary.references.begin(), binary.references.end(), 0U);
    struct Part {
        std::uint32_t node, first, count;
    };
    std::uint32_t used = 1;
    std::vector<Part> pending{{0, 0, n}};
    while (!pending.empty()) {
        const Part part = pending.back();
        pending.pop_back();
        const std::uint32_t left = part.count > 16 ? 16 : part.count / 2;
        const auto add = [&](std::uint32_t first, std::uint32_t count) {
            if (count == 1) return n - 1 + first;
            pending.push_back({used, first, count});
            return used++;
        };
        binary.children[part.node].left = add(part.first, left);
        binary.children[part.node].right = add(part.first + left, part.count - left);
    }
    fit_boxes(binary, mesh);
    return binary;
}

/// The same tree with its nodes numbered anyhow, but for the root.
BinaryBvh shuffled(const BinaryBvh& binary) {
    std::vector<std::uint32_t> place(binary.node_count());
    std::iota(place.begin(), place.end(), 0U);
    const std::uint32_t leaves = binary.first_leaf();
    std::mt19937 random(5);
    const auto shuffle = [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = end; i-- > begin + 1;)
            std::swap(place[i], place[begin + random() % (i + 1 - begin)]);
    };
    shuffle(1, leaves);
    shuffle(leaves, binary.node_count());
    BinaryBvh result = BinaryBvh::with_references(binary.reference_count());
    for (std::uint32_t node = 0; node < binary.node_count(); ++node) {
        result.boxes[place[node]] = binary.boxes[node];
        if (binary.is_leaf(node))
            result.references[place[node] - leaves] = binary.reference(node);
        else
            result.children[place[node]] = {place[binary.children[node].left],
                                            place[binary.children[node].right]};
    }
    return result;
}

TEST(OpenClCollapse, IsTheHostsForEveryBuilder) {
    const auto mesh = shared(random_soup(3000, 0.2F));
    for (const BuilderInfo& builder : builders()) {
        SCOPED_TRACE(builder.id);
        expect_the_hosts_bytes(built(builder.id, *mesh), mesh);
    }
}

TEST(OpenClCollapse, IsTheHostsForSurfaces) {
    const auto mesh = shared(sphere(60));
    expect_the_hosts_bytes(lbvh(*mesh), mesh);
    expect_the_hosts_bytes(built("sbvh", *mesh), mesh);
}

TEST(OpenClCollapse, IsTheHostsForOtherCosts) {
    const auto mesh = shared(random_soup(2000, 0.3F));
    for (const CostModel& model : {CostModel{1e-3, 1e3}, CostModel{1e3, 1e-3}, CostModel{3, 0.2}})
        expect_the_hosts_bytes(lbvh(*mesh), mesh, model);
}

TEST(OpenClCollapse, IsTheHostsForHardInputs) {
    Mesh flat = random_soup(2000), line = random_soup(2000);
    for (glm::vec3& vertex : flat.vertices) vertex.y = -0.0F;
    for (glm::vec3& vertex : line.vertices) vertex = glm::vec3(vertex.x);
    std::vector<Mesh> meshes;
    for (std::size_t count = 1; count <= 9; ++count) meshes.push_back(random_soup(count, 0.3F));
    meshes.push_back(copies(1));
    meshes.push_back(copies(20000));
    meshes.push_back(make_mesh(std::move(flat.vertices), std::move(flat.triangles)));
    meshes.push_back(make_mesh(std::move(line.vertices), std::move(line.triangles)));
    meshes.push_back(growing_chain(2000, 1.03));
    meshes.push_back(scaled(random_soup(1000), 1e-30F));
    meshes.push_back(scaled(random_soup(1000), 1e30F));
    for (Mesh& mesh : meshes) {
        const auto held = shared(std::move(mesh));
        SCOPED_TRACE(held->size());
        expect_the_hosts_bytes(lbvh(*held), held);
    }
}

TEST(OpenClCollapse, TakesNodesInAnyOrder) {
    const auto mesh = shared(random_soup(4000));
    expect_the_hosts_bytes(shuffled(lbvh(*mesh)), mesh);
    expect_the_hosts_bytes(shuffled(built("sbvh", *mesh)), mesh);
}

TEST(OpenClCollapse, TakesTreesAsDeepAsTheyAreLong) {
    const CostModel deep{1e-3, 1e3}, flat{1e3, 1e-3};
    const auto mesh = shared(random_soup(4000));
    expect_the_hosts_bytes(chain(*mesh), mesh, deep);
    expect_the_hosts_bytes(shuffled(chain(*mesh)), mesh, flat);  // one leaf of all
    expect_the_hosts_bytes(feathered_chain(*mesh), mesh, deep);
    // Longer than a work-item goes up in one launch.
    const auto line = shared(growing_chain(40000, 1.0));
    expect_the_hosts_bytes(chain(*line), line, deep, {}, {"cwbvh"});
}

TEST(OpenClCollapse, DoesNotDependOnTheGroupSize) {
    const auto mesh = shared(random_soup(3000, 0.2F));
    const auto line = shared(growing_chain(300, 1.0));
    const auto check = [&](std::size_t work_group, const Shapes& some) {
        SCOPED_TRACE(work_group);
        expect_the_hosts_bytes(lbvh(*mesh), mesh, {}, {work_group}, some);
        expect_the_hosts_bytes(chain(*line), line, {1e-3, 1e3}, {work_group}, some);
    };
    check(7, shapes);
    check(3, {"4"});
    check(96, {"cwbvh"});
}

TEST(OpenClCollapse, IsTheSameInEveryRun) {
    const auto mesh = shared(random_soup(20000));
    const BinaryBvh binary = shuffled(lbvh(*mesh));
    for (const std::string& shape : shapes)
        expect_same(OnDevice()(binary, mesh, shape, {}), OnDevice()(binary, mesh, shape, {}));
}

TEST(OpenClCollapse, IsTimedByStages) {
    const auto mesh = shared(random_soup(5000));
    Token token;
    Commands commands(*Device::open("opencl"), token);
    const DeviceBinary binary = upload(commands, lbvh(*mesh));
    collapse(commands, binary, mesh, upload(commands, *mesh), 8, {}, token);
    EXPECT_GT(commands.times().stage_seconds("collapsing"), 0.0);
    EXPECT_GT(commands.times().stage_seconds("layout"), 0.0);
    EXPECT_STREQ(token.stage(), "collapsing");
    EXPECT_EQ(token.fraction(), 1.0F);
}

TEST(OpenClCollapse, StopsAfterACancelAndRefusesOtherWidths) {
    const auto mesh = shared(random_soup(100));
    Token token;
    Commands commands(*Device::open("opencl"), token);
    const DeviceBinary binary = upload(commands, lbvh(*mesh));
    const DeviceMesh copy = upload(commands, *mesh);
    EXPECT_THROW(collapse(commands, binary, mesh, copy, 3, {}, token), std::invalid_argument);
    token.cancel();
    EXPECT_THROW(collapse(commands, binary, mesh, copy, 8, {}, token), Cancelled);
    EXPECT_THROW(compress(commands, binary, mesh, copy, {}, token), Cancelled);
}

}  // namespace
}  // namespace bvhlab::opencl
