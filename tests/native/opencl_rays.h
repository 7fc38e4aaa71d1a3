// SPDX-License-Identifier: GPL-3.0-or-later
// Rays traced on a device, against the CPU core's hits.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "build/lbvh.h"
#include "bvh/collapse.h"
#include "opencl/trace.h"
#include "rays.h"
#include "trace/trace.h"

namespace bvhlab::opencl::test {

using namespace bvhlab::test;

inline std::shared_ptr<Device> device() {
    return Device::open("opencl");
}

/// Rays at corners and points of edges, from near and far: double decides next to none of them.
inline Rays aimed_rays(const Mesh& mesh, std::size_t count) {
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

inline bool same_bits(const Array<float>& a, const Array<float>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

inline void expect_same(const Hits& expected, const Hits& hits, const std::string& what) {
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

inline ShapedHits trace_on_device(const Bvh& bvh, const Rays& rays, const Variant& variant) {
    Token token;
    Commands commands(*device(), token);
    if (variant.work_group) commands.work_group = variant.work_group;
    if (variant.suits_gpu) commands.suits_gpu = true;
    if (!variant.sub_groups) commands.use_sub_groups = false;
    const auto tree = upload_tree(commands, bvh);
    return trace(commands, bvh, *tree, rays.batch(), variant.options, token, variant.shape);
}

inline const std::vector<std::string> layouts{"2", "4", "8", "cwbvh"};

inline Bvh tree_of(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh,
                   const std::string& layout, const CostModel& model = {}) {
    Token token;
    if (layout == "cwbvh") return compress(binary, std::move(mesh), model, token);
    return collapse(binary, std::move(mesh), unsigned(std::stoi(layout)), model, token);
}

/// The CPU's answer and the device's, with the same options; with and without sub-groups, where the
/// device has them and the shape has threads that talk to each other.
inline void expect_the_cpus_hits(const Bvh& bvh, const Rays& rays, Variant variant,
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

}  // namespace bvhlab::opencl::test
