// SPDX-License-Identifier: GPL-3.0-or-later
// LBVH, HLBVH and PLOC on a device against the builders of the CPU, bit for bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <ostream>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "build/hlbvh.h"
#include "build/lbvh.h"
#include "build/ploc.h"
#include "bvh/depth_first.h"
#include "meshes.h"
#include "opencl/depth_first.h"
#include "opencl/hlbvh.h"
#include "opencl/lbvh.h"
#include "opencl/ploc.h"
#include "same_tree.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

std::shared_ptr<Device> device() {
    return Device::open("opencl");
}

/// How the work is shared out.
struct Sharing {
    std::size_t group = 64;
    bool suits_gpu = false;
};

constexpr Sharing sharings[] = {{64, false}, {64, true}, {3, true}, {7, true}, {96, true}};

using DeviceBuild = std::function<DeviceBinary(Commands&, const DeviceMesh&, Token&)>;

BinaryBvh on_device(const Mesh& mesh, const DeviceBuild& build, Sharing sharing = {}) {
    Token token;
    Commands commands(*device(), token);
    commands.work_group = sharing.group;
    commands.suits_gpu = sharing.suits_gpu;
    const DeviceMesh uploaded = upload(commands, mesh);
    return download(commands, build(commands, uploaded, token));
}

BinaryBvh device_hlbvh(const Mesh& mesh, const HlbvhConfig& config, Sharing sharing = {}) {
    return on_device(
        mesh,
        [&](Commands& commands, const DeviceMesh& uploaded, Token& token) {
            return build_hlbvh(commands, uploaded, config, token);
        },
        sharing);
}

BinaryBvh device_ploc(const Mesh& mesh, const PlocConfig& config, Sharing sharing = {}) {
    return on_device(
        mesh,
        [&](Commands& commands, const DeviceMesh& uploaded, Token& token) {
            return build_ploc(commands, uploaded, config, token);
        },
        sharing);
}

// --- all builders on all inputs -----------------------------------------------------------------

struct Builder {
    const char* name;
    BinaryBvh (*host)(const Mesh&);
    BinaryBvh (*device)(const Mesh&, Sharing);
};

const Builder all_builders[] = {
    {"Lbvh",
     [](const Mesh& mesh) {
         Token token;
         return bvhlab::build_lbvh(mesh, token);
     },
     [](const Mesh& mesh, Sharing sharing) { return on_device(mesh, build_lbvh, sharing); }},
    {"Hlbvh",
     [](const Mesh& mesh) {
         Token token;
         return bvhlab::build_hlbvh(mesh, {}, token);
     },
     [](const Mesh& mesh, Sharing sharing) { return device_hlbvh(mesh, {}, sharing); }},
    {"Ploc",
     [](const Mesh& mesh) {
         Token token;
         return bvhlab::build_ploc(mesh, {}, token);
     },
     [](const Mesh& mesh, Sharing sharing) { return device_ploc(mesh, {}, sharing); }},
};

struct Input {
    const char* name;
    Mesh (*make)();
};

Mesh changed(Mesh mesh, const std::function<void(glm::vec3&)>& change) {
    std::ranges::for_each(mesh.vertices, change);
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// Boxes that touch 0 and -0 on all sides: which of them is kept shows in the bits.
Mesh signed_zeros(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
        for (int axis = 0; axis < 3; ++axis)
            if ((i * 7 + std::size_t(axis)) % 5 < 3)
                mesh.vertices[i][axis] = (i + std::size_t(axis)) % 2 == 0 ? 0.0F : -0.0F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// All triangles but the last in one Morton cell.
Mesh one_cell_and_one_far_away(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (std::size_t i = 0; i + 3 < mesh.vertices.size(); ++i) mesh.vertices[i] *= 1e-3F;
    for (std::size_t i = mesh.vertices.size() - 3; i < mesh.vertices.size(); ++i)
        mesh.vertices[i] += 1e5F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

const Input inputs[] = {
    {"OneTriangle", [] { return random_soup(1); }},
    {"TwoTriangles", [] { return random_soup(2); }},
    {"ThreeTriangles", [] { return random_soup(3); }},
    {"Soup", [] { return random_soup(30000); }},
    {"Sphere", [] { return sphere(60); }},
    {"Copies", [] { return copies(20001); }},
    {"Coplanar", [] { return changed(random_soup(5000), [](glm::vec3& v) { v.y = 0.25F; }); }},
    {"Collinear",
     [] { return changed(random_soup(5000), [](glm::vec3& v) { v = glm::vec3(v.x); }); }},
    {"Tiny", [] { return changed(random_soup(3000), [](glm::vec3& v) { v *= 1e-30F; }); }},
    {"Huge", [] { return changed(random_soup(3000), [](glm::vec3& v) { v *= 1e30F; }); }},
    {"GrowingChain", [] { return growing_chain(3000, 1.03); }},
    {"SignedZeros", [] { return signed_zeros(3000); }},
    {"OneCellAndOneFarAway", [] { return one_cell_and_one_far_away(10000); }},
};

using BuilderAndInput = std::tuple<Builder, Input>;

class OpenClBuilders : public testing::TestWithParam<BuilderAndInput> {};

TEST_P(OpenClBuilders, BuildTheTreeOfTheCpu) {
    const auto& [builder, input] = GetParam();
    const Mesh mesh = input.make();
    EXPECT_TRUE(same(builder.device(mesh, {}), builder.host(mesh)));
}

std::string case_name(const testing::TestParamInfo<BuilderAndInput>& info) {
    return std::string(std::get<Builder>(info.param).name) + std::get<Input>(info.param).name;
}

INSTANTIATE_TEST_SUITE_P(OpenCl, OpenClBuilders,
                         testing::Combine(testing::ValuesIn(all_builders),
                                          testing::ValuesIn(inputs)),
                         case_name);

/// For any size of work-groups, on a CPU's and on a GPU's paths, and in every run.
TEST(OpenClBuild, DoesNotDependOnHowWorkIsSharedOut) {
    const Mesh mesh = sphere(40);
    for (const Builder& builder : all_builders) {
        const BinaryBvh expected = builder.host(mesh);
        for (const Sharing sharing : sharings)
            for (int run = 0; run < 2; ++run)
                EXPECT_TRUE(same(builder.device(mesh, sharing), expected))
                    << builder.name << ", groups of " << sharing.group
                    << (sharing.suits_gpu ? ", as on a GPU" : "");
    }
}

// --- settings -----------------------------------------------------------------------------------

TEST(OpenClHlbvh, BuildsTheTreeOfTheCpuForAllSettings) {
    const Mesh soup = random_soup(4000), ball = sphere(30);
    for (const Mesh* mesh : {&soup, &ball}) {
        for (const int bits : {3, 4, 5, 10, 18, 21}) {
            Token token;
            const BinaryBvh expected = bvhlab::build_hlbvh(*mesh, {bits}, token);
            for (const bool suits_gpu : {false, true})
                EXPECT_TRUE(same(device_hlbvh(*mesh, {bits}, {64, suits_gpu}), expected)) << bits;
        }
    }
}

TEST(OpenClPloc, BuildsTheTreeOfTheCpuForAllSettings) {
    const Mesh mesh = random_soup(3000);
    for (const PlocConfig config : {PlocConfig{1, 1, 1.0}, PlocConfig{3, 512, 1.2},
                                    PlocConfig{100, 8, 1.5}, PlocConfig{512, 512, 1.0}}) {
        Token token;
        const BinaryBvh expected = bvhlab::build_ploc(mesh, config, token);
        for (const std::size_t group : {std::size_t(33), std::size_t(64)})
            EXPECT_TRUE(same(device_ploc(mesh, config, {group, true}), expected)) << config.radius;
    }
}

/// More candidates than one launch looks at.
TEST(OpenClPloc, SearchesLongRowsInSeveralLaunches) {
    const Mesh mesh = random_soup(132000);
    const PlocConfig config{512, 512, 1.0};
    Token token;
    EXPECT_TRUE(same(device_ploc(mesh, config), bvhlab::build_ploc(mesh, config, token)));
}

TEST(OpenClBuild, StopsWhenCancelled) {
    Token token;
    Commands commands(*device(), token);
    const DeviceMesh mesh = upload(commands, random_soup(100));
    token.cancel();
    EXPECT_THROW(build_lbvh(commands, mesh, token), Cancelled);
    EXPECT_THROW(build_hlbvh(commands, mesh, {}, token), Cancelled);
    EXPECT_THROW(build_ploc(commands, mesh, {}, token), Cancelled);
}

// --- depth-first order --------------------------------------------------------------------------

/// A tree that splits off one leaf after the other, on the left where `turns` says so.
BinaryBvh caterpillar(std::uint32_t count, const std::function<bool(std::uint32_t)>& turns) {
    BinaryBvh bvh = BinaryBvh::with_references(count);
    for (std::uint32_t node = 0; node + 1 < count; ++node) {
        const std::uint32_t leaf = count - 1 + node;
        const std::uint32_t rest = node + 2 < count ? node + 1 : 2 * count - 2;
        bvh.children[node] =
            turns(node) ? BinaryBvh::Children{rest, leaf} : BinaryBvh::Children{leaf, rest};
    }
    for (std::uint32_t i = 0; i < count; ++i) bvh.references[i] = count - i;
    for (std::uint32_t i = 0; i < 2 * count - 1; ++i) bvh.boxes[i] = {glm::vec3(0), glm::vec3(i)};
    return bvh;
}

/// The same tree with interior nodes and leaves numbered at random; the root stays 0.
BinaryBvh shuffled(const BinaryBvh& bvh) {
    std::mt19937 random(3);
    std::vector<std::uint32_t> numbers(bvh.node_count());
    for (std::uint32_t i = 0; i < numbers.size(); ++i) numbers[i] = i;
    const auto shuffle = [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i + 1 < end; ++i)
            std::swap(numbers[i], numbers[i + random() % (end - i)]);
    };
    shuffle(1, bvh.first_leaf());
    shuffle(bvh.first_leaf(), numbers.size());

    BinaryBvh result = BinaryBvh::with_references(bvh.reference_count());
    for (std::uint32_t i = 0; i < numbers.size(); ++i) {
        result.boxes[numbers[i]] = bvh.boxes[i];
        if (bvh.is_leaf(i))
            result.references[numbers[i] - bvh.first_leaf()] = bvh.reference(i);
        else
            result.children[numbers[i]] = {numbers[bvh.children[i].left],
                                           numbers[bvh.children[i].right]};
    }
    return result;
}

void check_depth_first(const BinaryBvh& bvh) {
    const BinaryBvh expected = bvhlab::depth_first(bvh);
    for (const std::size_t group : {7, 64}) {
        const Token token;
        Commands commands(*device(), token);
        commands.work_group = group;
        const DeviceBinary uploaded = upload(commands, bvh);
        EXPECT_TRUE(same(download(commands, depth_first(commands, uploaded)), expected))
            << bvh.reference_count();
    }
}

TEST(OpenClDepthFirst, GivesTheOrderOfTheCpu) {
    Token token;
    for (const std::size_t count : {1, 2, 3, 5000})
        check_depth_first(shuffled(bvhlab::build_lbvh(random_soup(count), token)));
}

TEST(OpenClDepthFirst, HandlesTreesAsDeepAsTheyAreLarge) {
    check_depth_first(shuffled(caterpillar(20000, [](std::uint32_t) { return true; })));
    check_depth_first(shuffled(caterpillar(20000, [](std::uint32_t) { return false; })));
    check_depth_first(shuffled(caterpillar(4097, [](std::uint32_t i) { return i % 3 == 0; })));
}

}  // namespace
}  // namespace bvhlab::opencl
