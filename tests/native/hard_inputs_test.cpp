// SPDX-License-Identifier: GPL-3.0-or-later
// Every builder on inputs that have broken builders: they must end fast, be valid and give the hits
// of every other tree.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <ostream>
#include <tuple>

#include "build/builder.h"
#include "bvh/collapse.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "trace/trace.h"

namespace bvhlab {
namespace {

using namespace test;

Mesh changed(Mesh mesh, const std::function<void(glm::vec3&)>& change) {
    std::ranges::for_each(mesh.vertices, change);
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// Triangles one behind the other on the diagonal.
Mesh collinear(std::size_t count) {
    return changed(random_soup(count), [](glm::vec3& v) { v = glm::vec3(v.x); });
}

/// Points and segments only.
Mesh without_area(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (std::size_t i = 0; i < mesh.size(); ++i) {
        glm::uvec3& corners = mesh.triangles[i];
        corners.z = corners.y;
        if (i % 2 == 0) corners.y = corners.x;
        if (i % 4 == 0) corners.z = corners.x;
    }
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

/// All triangles but the last in one of 2^60 Morton cells.
Mesh one_cell_and_one_far_away(std::size_t count) {
    Mesh mesh = random_soup(count);
    for (std::size_t i = 0; i + 3 < mesh.vertices.size(); ++i) mesh.vertices[i] *= 1e-3F;
    for (std::size_t i = mesh.vertices.size() - 3; i < mesh.vertices.size(); ++i)
        mesh.vertices[i] += 1e5F;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

struct HardInput {
    const char* name;
    Mesh (*make)();
    int rays;  ///< fewer where a ray meets thousands of triangles at one point
};

const HardInput hard_inputs[] = {
    {"OneTriangle", [] { return random_soup(1); }, 300},
    {"TwoTriangles", [] { return random_soup(2); }, 300},
    {"Copies", [] { return copies(100000); }, 2},
    {"Coplanar", [] { return changed(random_soup(20000), [](glm::vec3& v) { v.y = 0.25F; }); },
     100},
    {"Collinear", [] { return collinear(10000); }, 50},
    {"WithoutArea", [] { return without_area(20000); }, 300},
    {"Tiny", [] { return changed(random_soup(10000), [](glm::vec3& v) { v *= 1e-30F; }); }, 300},
    {"Huge", [] { return changed(random_soup(10000), [](glm::vec3& v) { v *= 1e30F; }); }, 300},
    {"GrowingChain", [] { return growing_chain(3000, 1.03); }, 300},
    {"OneCellAndOneFarAway", [] { return one_cell_and_one_far_away(50000); }, 100},
};

/// Rays that each pass through one of the triangles, from nearby.
struct Rays {
    Array<glm::vec3> origins, directions;
    float t_min = 0.0F, t_max = std::numeric_limits<float>::infinity();

    Rays(const Mesh& mesh, int count) {
        std::mt19937 random(7);
        for (int i = 0; i < count; ++i) {
            const std::size_t aim = random() % mesh.size();
            const Triangle triangle = mesh.triangle(aim);
            const glm::vec3 size = mesh.box(aim).upper - mesh.box(aim).lower;
            const float length = 3.0F * std::max({size.x, size.y, size.z, 1e-37F});
            directions.push_back(length * uniform_vector(random, 0.1F, 1.0F));
            origins.push_back(0.25F * triangle.a + 0.35F * triangle.b + 0.4F * triangle.c -
                              directions.back());
        }
    }

    RayBatch batch() const { return {origins, directions, {&t_min, 1}, {&t_max, 1}}; }
};

/// A hard mesh with rays and their hits in the LBVH.
struct Case {
    std::shared_ptr<const Mesh> mesh;
    Rays rays;
    Hits expected;

    explicit Case(const HardInput& input) : mesh(shared(input.make())), rays(*mesh, input.rays) {
        Token token;
        BuildLog log;
        const BuilderInfo& lbvh = find_builder("lbvh");
        const BinaryBvh bvh = lbvh.build(*mesh, {}, check_parameters(lbvh, {}), token, log);
        expected = trace(collapse(bvh, mesh, 2, {}, token), rays.batch(), {}, token);
    }
};

/// Made once for all builders.
const Case& hard_case(const HardInput& input) {
    static std::map<std::string, Case> cases;
    const auto found = cases.find(input.name);
    return found != cases.end() ? found->second : cases.emplace(input.name, input).first->second;
}

bool same_bits(const Array<float>& a, const Array<float>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

using BuilderAndInput = std::tuple<BuilderInfo, HardInput>;

/// For the messages of GoogleTest.
void PrintTo(const BuilderAndInput& given, std::ostream* out) {
    *out << std::get<BuilderInfo>(given).id << " " << std::get<HardInput>(given).name;
}

class HardInputs : public testing::TestWithParam<BuilderAndInput> {};

TEST_P(HardInputs, BuildAndGiveTheHitsOfLbvh) {
    const auto& [builder, input] = GetParam();
    const auto& [mesh, rays, expected] = hard_case(input);

    // A few iterations of the builders that work in iterations.
    Parameters given;
    for (const ParameterInfo& parameter : builder.parameters)
        if (parameter.name == "iterations") given["iterations"] = std::max(parameter.minimum, 3.0);
    Token token;
    BuildLog log;
    const BinaryBvh binary = builder.build(*mesh, {}, check_parameters(builder, given), token, log);
    ASSERT_NO_THROW(validate(binary, *mesh));

    for (const std::string shape : {"2", "4", "8", "cwbvh"}) {
        const Bvh bvh = shape == "cwbvh"
                            ? compress(binary, mesh, {}, token)
                            : collapse(binary, mesh, unsigned(std::stoi(shape)), {}, token);
        ASSERT_NO_THROW(validate(bvh)) << shape;
        const Hits hits = trace(bvh, rays.batch(), {}, token);
        EXPECT_EQ(hits.triangle, expected.triangle) << shape;
        EXPECT_TRUE(same_bits(hits.t, expected.t)) << shape;
        EXPECT_TRUE(same_bits(hits.u, expected.u)) << shape;
        EXPECT_TRUE(same_bits(hits.v, expected.v)) << shape;
    }
}

/// The rays would prove little if they all missed.
TEST(HardInputRays, Hit) {
    for (const HardInput& input : hard_inputs) {
        const auto& triangles = hard_case(input).expected.triangle;
        const auto misses = std::ranges::count(triangles, no_triangle);
        const std::string name = input.name;
        if (name == "Collinear" || name == "WithoutArea")
            EXPECT_EQ(std::size_t(misses), triangles.size()) << name;
        else
            EXPECT_LT(std::size_t(misses), triangles.size() / 2) << name;
    }
}

std::string case_name(const testing::TestParamInfo<BuilderAndInput>& info) {
    return std::string(std::get<BuilderInfo>(info.param).id) + "_" +
           std::get<HardInput>(info.param).name;
}

INSTANTIATE_TEST_SUITE_P(Builders, HardInputs,
                         testing::Combine(testing::ValuesIn(builders().begin(), builders().end()),
                                          testing::ValuesIn(hard_inputs)),
                         case_name);

}  // namespace
}  // namespace bvhlab
