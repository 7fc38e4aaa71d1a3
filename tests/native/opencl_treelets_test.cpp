// SPDX-License-Identifier: GPL-3.0-or-later
// Treelet restructuring on a device, against the CPU core; on PoCL in CI.
#include <gtest/gtest.h>

#include <cmath>
#include <thread>
#include <vector>

#include "build/lbvh.h"
#include "bvh/depth_first.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "opencl/atrbvh.h"
#include "opencl/depth_first.h"
#include "opencl/trbvh.h"
#include "opencl/treelet.h"
#include "same_tree.h"

namespace bvhlab::opencl {
namespace {

using namespace test;

std::shared_ptr<Device> device() {
    return Device::open("opencl");
}

// --- meshes -------------------------------------------------------------------------------------

/// Triangles squeezed into a plane (one axis flat), a line (two), or a point (three); at 0 or -0.
Mesh flattened(Mesh mesh, int flat_axes) {
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
        for (int axis = 0; axis < flat_axes; ++axis)
            mesh.vertices[i][axis] = i / 3 % 3 == 0 ? -0.0F : 0.0F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// Node i has leaf i on the left and the rest on the right.
BinaryBvh chain(const Mesh& mesh) {
    const auto n = std::uint32_t(mesh.size());
    BinaryBvh bvh = BinaryBvh::with_references(n);
    for (std::uint32_t i = 0; i < n; ++i) {
        bvh.references[i] = i;
        bvh.boxes[n - 1 + i] = mesh.box(i);
    }
    for (std::uint32_t i = n - 1; i-- > 0;) {
        bvh.children[i] = {n - 1 + i, i + 2 < n ? i + 1 : 2 * n - 2};
        bvh.boxes[i] = unite(bvh.boxes[n - 1 + i], bvh.boxes[bvh.children[i].right]);
    }
    return bvh;
}

BinaryBvh lbvh(const Mesh& mesh) {
    Token token;
    return bvhlab::build_lbvh(mesh, token);
}

// --- passes -------------------------------------------------------------------------------------

/// Levels of a tree as the device finds them, with nodes and begins.
struct HostLevels {
    std::vector<std::uint32_t> nodes, begins;
};

HostLevels device_levels(const BinaryBvh& bvh, std::size_t gamma, std::size_t work_group) {
    const Token token;
    Commands commands(*device(), token);
    commands.work_group = work_group;
    const DeviceBinary on_device = upload(commands, bvh);
    const TreeletLevels levels = TreeletPasses(commands, on_device).find_levels(gamma);
    HostLevels host{std::vector<std::uint32_t>(levels.begins.back()), levels.begins};
    commands.download(levels.nodes, std::span(host.nodes));
    return host;
}

/// The same by another way: heights from the leaves up, in order of number.
HostLevels slow_levels(const BinaryBvh& bvh, std::size_t gamma) {
    const Array<std::uint32_t> counts = reference_counts(bvh, Token());
    std::vector<std::uint32_t> order{0};  // each node before its children
    for (std::size_t i = 0; i < order.size(); ++i) {
        const auto [left, right] = bvh.children[order[i]];
        for (const std::uint32_t child : {left, right})
            if (!bvh.is_leaf(child)) order.push_back(child);
    }
    std::vector<std::uint32_t> heights(counts.size(), 0);
    for (std::size_t i = order.size(); i-- > 0;) {
        const auto [left, right] = bvh.children[order[i]];
        for (const std::uint32_t child : {left, right})
            if (!bvh.is_leaf(child) && counts[child] >= gamma)
                heights[order[i]] = std::max(heights[order[i]], heights[child] + 1);
    }
    HostLevels levels;
    for (std::uint32_t height = 0; height <= heights[0]; ++height) {
        levels.begins.push_back(std::uint32_t(levels.nodes.size()));
        for (std::uint32_t node = 0; node < counts.size(); ++node)
            if (counts[node] >= gamma && heights[node] == height) levels.nodes.push_back(node);
    }
    levels.begins.push_back(std::uint32_t(levels.nodes.size()));
    return levels;
}

TEST(OpenClTreelets, CountReferences) {
    const Mesh mesh = random_soup(3000);
    for (const BinaryBvh& bvh : {lbvh(mesh), chain(mesh), lbvh(copies(2))}) {
        for (const std::size_t work_group : {7, 64}) {
            const Token token;
            Commands commands(*device(), token);
            commands.work_group = work_group;
            const DeviceBinary on_device = upload(commands, bvh);
            const TreeletPasses passes(commands, on_device);
            Array<std::uint32_t> counts(bvh.children.size());
            commands.download(passes.references(), std::span(counts));
            EXPECT_EQ(counts, reference_counts(bvh, token)) << work_group;
        }
    }
}

TEST(OpenClTreelets, FindEachNodeAfterAllBelow) {
    const Mesh mesh = random_soup(3000);
    for (const BinaryBvh& bvh : {lbvh(mesh), chain(mesh), lbvh(copies(3000))}) {
        for (const std::size_t gamma : {2, 20, 640, 3000}) {
            const HostLevels expected = slow_levels(bvh, gamma);
            for (const std::size_t work_group : {7, 64}) {
                const HostLevels levels = device_levels(bvh, gamma, work_group);
                EXPECT_EQ(levels.begins, expected.begins) << gamma << " " << work_group;
                EXPECT_EQ(levels.nodes, expected.nodes) << gamma << " " << work_group;
            }
        }
    }
}

// --- the same trees -----------------------------------------------------------------------------

BinaryBvh on_cpu(const Mesh& mesh, const CostModel& model, const AtrbvhConfig& config,
                 BuildLog& log) {
    Token token;
    return bvhlab::build_atrbvh(mesh, model, config, token, log);
}

BinaryBvh on_cpu(const Mesh& mesh, const CostModel& model, const TrbvhConfig& config,
                 BuildLog& log) {
    Token token;
    return bvhlab::build_trbvh(mesh, model, config, token, log);
}

DeviceBinary built(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                   const AtrbvhConfig& config, Token& token, BuildLog& log) {
    return build_atrbvh(commands, mesh, model, config, token, log);
}

DeviceBinary built(Commands& commands, const DeviceMesh& mesh, const CostModel& model,
                   const TrbvhConfig& config, Token& token, BuildLog& log) {
    return build_trbvh(commands, mesh, model, config, token, log);
}

template <class Config>
BinaryBvh on_device(const Mesh& mesh, const CostModel& model, const Config& config, BuildLog& log) {
    Token token;
    Commands commands(*device(), token);
    const DeviceMesh device_mesh = upload(commands, mesh);
    return download(commands, built(commands, device_mesh, model, config, token, log));
}

/// The passes over an LBVH of the CPU's, shared out as suits a GPU.
template <class Config>
BinaryBvh restructured(const Mesh& mesh, const Config& config, BuildLog& log,
                       std::size_t work_group) {
    Token token;
    Commands commands(*device(), token);
    commands.suits_gpu = true;
    commands.work_group = work_group;
    DeviceBinary bvh = upload(commands, lbvh(mesh));
    restructure(commands, bvh, {}, config, Stopwatch(), token, log);
    return bvhlab::depth_first(download(commands, bvh));
}

/// Sums of the device are made in another order.
void expect_same_log(const BuildLog& log, const BuildLog& expected) {
    EXPECT_STREQ(log.ended, expected.ended);
    ASSERT_EQ(log.steps.size(), expected.steps.size());
    for (std::size_t i = 0; i < log.steps.size(); ++i) {
        EXPECT_EQ(log.steps[i].iteration, expected.steps[i].iteration);
        EXPECT_NEAR(log.steps[i].cost, expected.steps[i].cost, 1e-12 * expected.steps[i].cost);
    }
}

template <class Config>
void expect_cpu_tree(const Mesh& mesh, const Config& config, const CostModel& model = {}) {
    BuildLog log, expected_log;
    const BinaryBvh expected = on_cpu(mesh, model, config, expected_log);
    const BinaryBvh bvh = on_device(mesh, model, config, log);
    EXPECT_TRUE(same(bvh, expected)) << mesh.size() << " triangles";
    expect_same_log(log, expected_log);
}

/// Few triangles, hard ones, and many.
std::vector<Mesh> meshes() {
    std::vector<Mesh> all;
    for (const std::size_t count : {1, 2, 3, 6, 7, 8, 19, 20, 21, 20000})
        all.push_back(random_soup(count));
    all.push_back(random_soup(5000, 2));
    all.push_back(copies(5000));
    all.push_back(sphere(40));
    for (const int flat_axes : {1, 2, 3}) all.push_back(flattened(random_soup(3000), flat_axes));
    all.push_back(growing_chain(3000, 1.03));
    all.push_back(growing_chain(100, 3.0));
    for (const float factor : {1e30F, 5e36F, 1e-30F, 1e-40F})
        all.push_back(scaled(random_soup(3000), factor));
    return all;
}

TEST(OpenClTreelets, MakeTheCpusAtrbvh) {
    for (const Mesh& mesh : meshes()) expect_cpu_tree(mesh, AtrbvhConfig{});
}

TEST(OpenClTreelets, MakeTheCpusTrbvh) {
    for (const Mesh& mesh : meshes()) expect_cpu_tree(mesh, TrbvhConfig{});
}

TEST(OpenClTreelets, MakeTheCpusTreeForOtherTreeletSizes) {
    for (const Mesh& mesh : {random_soup(3000), copies(500)}) {
        for (const int size : {4, 30}) expect_cpu_tree(mesh, AtrbvhConfig{.treelet_size = size});
        for (const int size : {3, 8}) expect_cpu_tree(mesh, TrbvhConfig{.treelet_size = size});
    }
}

TEST(OpenClTreelets, MakeTheCpusTrbvhForOtherCosts) {
    const Mesh mesh = random_soup(3000, 0.5F);
    for (const CostModel& model : {CostModel{0.3, 2.0}, CostModel{10.0, 1.0}})
        expect_cpu_tree(mesh, TrbvhConfig{.iterations = 64}, model);
}

template <class Config>
void expect_same_for_any_lanes(const Config& config) {
    for (const Mesh& mesh : {random_soup(2000), growing_chain(300, 1.03), copies(100)}) {
        BuildLog expected_log;
        const BinaryBvh expected = on_cpu(mesh, {}, config, expected_log);
        std::vector<double> costs;
        for (const std::size_t work_group : {7, 64}) {  // 7 and 32 lanes
            BuildLog log;
            EXPECT_TRUE(same(restructured(mesh, config, log, work_group), expected)) << work_group;
            expect_same_log(log, expected_log);
            costs.push_back(log.steps.back().cost);
        }
        EXPECT_EQ(costs, std::vector(costs.size(), costs.front()));  // bit for bit
    }
}

TEST(OpenClTreelets, AgglomerateWithAnyNumberOfWorkItems) {
    expect_same_for_any_lanes(AtrbvhConfig{});
}

TEST(OpenClTreelets, OptimiseWithAnyNumberOfWorkItems) {
    expect_same_for_any_lanes(TrbvhConfig{});
}

TEST(OpenClTreelets, MakeTheSameTreeTwice) {
    const Mesh mesh = random_soup(20000, 0.3F);
    BuildLog log, again;
    EXPECT_TRUE(
        same(on_device(mesh, {}, AtrbvhConfig{}, log), on_device(mesh, {}, AtrbvhConfig{}, again)));
    EXPECT_EQ(log.steps.back().cost, again.steps.back().cost);
    EXPECT_TRUE(
        same(on_device(mesh, {}, TrbvhConfig{}, log), on_device(mesh, {}, TrbvhConfig{}, again)));
    EXPECT_EQ(log.steps.back().cost, again.steps.back().cost);
}

// --- limits -------------------------------------------------------------------------------------

template <class Config>
void expect_limits_kept(Config config) {
    const Mesh mesh = random_soup(10000);
    for (const int iterations : {0, 2}) {
        config.iterations = iterations;
        expect_cpu_tree(mesh, config);
    }
    config.iterations = 20;
    for (const double seconds : {1e-9, 0.01}) {
        BuildLog log;
        config.max_seconds = seconds;
        EXPECT_NO_THROW(validate(on_device(mesh, {}, config, log), mesh));
        if (seconds < 0.01) {
            EXPECT_STREQ(log.ended, "time limit");
        }
    }
}

TEST(OpenClTreelets, KeepToTheirLimits) {
    expect_limits_kept(AtrbvhConfig{});
    expect_limits_kept(TrbvhConfig{});
}

/// Cancels once the passes have begun.
template <class Config>
void expect_cancelled(const Config& config) {
    Token token;
    Commands commands(*device(), token);
    const DeviceMesh mesh = upload(commands, random_soup(100000));
    BuildLog log;
    std::thread canceller([&] {
        while (std::isnan(token.cost())) std::this_thread::yield();
        token.cancel();
    });
    EXPECT_THROW(built(commands, mesh, {}, config, token, log), Cancelled);
    canceller.join();
}

TEST(OpenClTreelets, StopWhenCancelled) {
    expect_cancelled(AtrbvhConfig{.treelet_size = 30});
    expect_cancelled(TrbvhConfig{.treelet_size = 8});
}

TEST(OpenClTreelets, ReportProgressAndCost) {
    Token token;
    Commands commands(*device(), token);
    const DeviceMesh mesh = upload(commands, random_soup(2000));
    BuildLog log;
    build_atrbvh(commands, mesh, {}, {}, token, log);
    EXPECT_STREQ(token.stage(), "building ATRBVH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    EXPECT_EQ(token.cost(), log.steps.back().cost);
    build_trbvh(commands, mesh, {}, {}, token, log);
    EXPECT_STREQ(token.stage(), "building TRBVH");
    EXPECT_FLOAT_EQ(token.fraction(), 1.0F);
    EXPECT_EQ(token.cost(), log.steps.back().cost);
}

}  // namespace
}  // namespace bvhlab::opencl
