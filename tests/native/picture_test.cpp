// SPDX-License-Identifier: GPL-3.0-or-later
// Whole pictures and measured ray sets: closed forms, and the same answer from every variant.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <stdexcept>

#include "build/builder.h"
#include "bvh/collapse.h"
#include "meshes.h"
#include "render/direct_light.h"
#include "render/secondary.h"
#include "trace/trace.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

Bvh tree_of(const std::shared_ptr<const Mesh>& mesh, std::string_view builder = "lbvh",
            unsigned branching = 8) {
    Token token;
    const BuilderInfo& info = find_builder(builder);
    BuildLog log;
    Parameters few;  // annealing would take thousands
    for (const ParameterInfo& parameter : info.parameters)
        if (parameter.name == "iterations") few.emplace("iterations", 10.0);
    const BinaryBvh binary = info.build(*mesh, {}, check_parameters(info, few), token, log);
    return collapse(binary, mesh, branching, {}, token);
}

Scene scene_of(Mesh mesh, std::vector<Light> lights, float world = 0.0F, Material material = {}) {
    Array<std::uint32_t> index(mesh.size(), 0U);
    return make_scene(test::shared(std::move(mesh)), {material}, std::move(index),
                      std::move(lights), glm::vec3(world));
}

/// A square in the plane at this height, of half side `half`.
void add_square(Array<glm::vec3>& vertices, Array<glm::uvec3>& triangles, float height,
                float half) {
    const auto first = std::uint32_t(vertices.size());
    for (const glm::vec2 corner : {glm::vec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
        vertices.push_back({corner * half, height});
    triangles.push_back({first, first + 1, first + 2});
    triangles.push_back({first, first + 2, first + 3});
}

Mesh plane(float half = 100.0F) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, half);
    return make_mesh(std::move(vertices), std::move(triangles));
}

Light lamp(LightKind kind, float power, const glm::dvec3& place) {
    Light light;
    light.kind = kind;
    light.to_world = glm::translate(glm::dmat4(1.0), place);
    light.color = glm::vec3(power);
    return light;
}

/// Looks down from a height of 5 on a square of this half side.
Camera from_above(double half) {
    Camera camera;
    camera.kind = CameraKind::orthographic;
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 5));
    camera.left = camera.bottom = -half;
    camera.right = camera.top = half;
    return camera;
}

Picture picture_of(const Bvh& bvh, const Scene& scene, const Camera& camera, std::uint32_t side,
                   std::uint32_t samples, int threads = 0) {
    Token token;
    return render(bvh, scene, camera, {{side, side, 3}, samples, threads}, token);
}

Picture picture_of(const Scene& scene, const Camera& camera, std::uint32_t side,
                   std::uint32_t samples) {
    return picture_of(tree_of(scene.mesh), scene, camera, side, samples);
}

double mean(const Picture& picture) {
    double sum = 0.0;
    for (const glm::vec3& pixel : picture.pixels) sum += double(pixel.x);
    return sum / double(picture.pixels.size());
}

constexpr Material white{glm::vec3(1.0F), glm::vec3(0.0F)};

TEST(Picture, WhiteFurnaceIsOneEverywhere) {
    // A convex solid of albedo 1 in a world of radiance 1 cannot be seen, at any scale.
    for (const auto& [centre, radius] : {std::pair(glm::vec3(0.0F), 1.0F),
                                         {glm::vec3(300.0F, -200.0F, 100.0F), 1.0F},
                                         {glm::vec3(0.0F), 1e-6F}}) {
        const Scene scene = scene_of(test::sphere(12, centre, radius), {}, 1.0F, white);
        Camera camera = from_above(1.2 * radius);
        camera.to_world =
            glm::translate(glm::dmat4(1.0), glm::dvec3(centre) + glm::dvec3(0, 0, 3.0 * radius));
        for (const glm::vec3& pixel : picture_of(scene, camera, 32, 4).pixels)
            EXPECT_NEAR(pixel.x, 1.0F, 1e-6F);
    }
}

TEST(Picture, PointLightOnAPlaneFollowsLambertAndTheInverseSquare) {
    const Scene scene = scene_of(plane(), {lamp(LightKind::point, 100, {0, 0, 2})});
    const Picture picture = picture_of(scene, from_above(1.0), 3, 1);
    const auto expected = [](double across) {
        const double squared = 4.0 + across * across;
        return 0.8 / pi * 100 / (4 * pi) / squared * 2.0 / std::sqrt(squared);
    };
    EXPECT_NEAR(picture.pixels[4].x, expected(0.0), 1e-5);
    EXPECT_NEAR(picture.pixels[5].x, expected(2.0 / 3.0), 1e-5);
    EXPECT_NEAR(picture.pixels[0].x, expected(std::sqrt(8.0) / 3.0), 1e-5);
}

TEST(Picture, EmissionIsSeenAndShinesOnItsSurroundings) {
    // An emitting square of half side h at height h: its form factor on the axis is
    // 4 / pi * sqrt(1/2) * atan(sqrt(1/2)).
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 100.0F);
    add_square(vertices, triangles, 6.0F, 6.0F);
    const auto mesh = test::shared(make_mesh(std::move(vertices), std::move(triangles)));
    const Scene scene = make_scene(mesh, {Material{}, {glm::vec3(0.0F), glm::vec3(3.0F)}},
                                   {0, 0, 1, 1}, {}, glm::vec3(0.0F));
    const double expected = 0.8 * 3.0 * 4.0 / pi * std::sqrt(0.5) * std::atan(std::sqrt(0.5));
    EXPECT_NEAR(mean(picture_of(scene, from_above(0.1), 4, 1024)), expected, 2e-3);
    Camera camera = from_above(0.1);
    camera.to_world = glm::rotate(camera.to_world, pi, glm::dvec3(1, 0, 0));
    EXPECT_EQ(mean(picture_of(scene, camera, 4, 4)), 3.0);
}

TEST(Picture, OccludersCastShadowsAndThoseBehindTheLampDoNot) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 100.0F);
    add_square(vertices, triangles, 1.0F, 0.5F);
    const auto mesh = test::shared(make_mesh(std::move(vertices), std::move(triangles)));
    const auto scene = [&](double height) {
        return make_scene(mesh, {Material{}}, {0, 0, 0, 0},
                          {lamp(LightKind::point, 100, {0, 0, height})}, glm::vec3(0.0F));
    };
    Camera camera = from_above(0.2);
    camera.clip_start = 4.5;  // between floor and square
    EXPECT_EQ(mean(picture_of(scene(2.0), camera, 8, 1)), 0.0);
    EXPECT_GT(mean(picture_of(scene(0.9), camera, 8, 1)), 1.0);
}

TEST(Picture, AreaLampInThePlaneOfACeilingIsNotShadowedByIt) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 100.0F);
    add_square(vertices, triangles, 2.3F, 100.0F);
    Light light = lamp(LightKind::area, 100, {0, 0, double(2.3F)});
    light.size_x = light.size_y = 1.0;
    Camera camera = from_above(1.0);
    camera.clip_start = 3.0;
    const Scene open = scene_of(plane(), {light});
    const Scene closed = scene_of(make_mesh(std::move(vertices), std::move(triangles)), {light});
    EXPECT_EQ(picture_of(open, camera, 16, 4).pixels, picture_of(closed, camera, 16, 4).pixels);
}

TEST(Picture, ManyLightsAreDrawnWithoutBias) {
    const Scene one = scene_of(plane(), {lamp(LightKind::point, 100, {0, 0, 2})});
    const Scene many =
        scene_of(plane(), std::vector<Light>(20, lamp(LightKind::point, 5, {0, 0, 2})));
    const Picture expected = picture_of(one, from_above(1.0), 4, 1);
    const Picture drawn = picture_of(many, from_above(1.0), 4, 1);
    for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(drawn.pixels[i].x, expected.pixels[i].x, 1e-5);
    EXPECT_EQ(drawn.rays, 16U * (1 + most_lights_at_a_hit));
}

TEST(Picture, OnlyTheRaysThatTheSceneNeedsAreTraced) {
    const auto rays = [](std::vector<Light> lights, float world) {
        return picture_of(scene_of(plane(), std::move(lights), world), from_above(1.0), 4, 1).rays;
    };
    const Light above = lamp(LightKind::point, 1, {0, 0, 2}),
                below = lamp(LightKind::point, 1, {0, 0, -2});
    EXPECT_EQ(rays({}, 0.0F), 16U);
    EXPECT_EQ(rays({}, 1.0F), 32U);
    EXPECT_EQ(rays({above}, 0.0F), 32U);
    EXPECT_EQ(rays({below}, 0.0F), 16U);
    EXPECT_EQ(rays({above, below, above}, 1.0F), 64U);
}

/// Soup of two materials, one emitting, under one lamp of each kind and a grey world.
Scene crowded_scene() {
    Mesh mesh = test::random_soup(3000);
    Array<std::uint32_t> index(mesh.size());
    for (std::size_t i = 0; i < index.size(); ++i) index[i] = i % 50 == 0 ? 1U : 0U;
    std::vector<Light> lights;
    for (const LightKind kind :
         {LightKind::point, LightKind::sun, LightKind::spot, LightKind::area}) {
        lights.push_back(lamp(kind, 5, {0.2, 0.4, 2.0}));
        lights.back().size_x = lights.back().size_y = 0.3;
        lights.back().spot_blend = 0.5;
    }
    return make_scene(test::shared(std::move(mesh)),
                      {Material{}, {glm::vec3(0.3F), glm::vec3(4.0F)}}, std::move(index),
                      std::move(lights), glm::vec3(0.2F));
}

TEST(Picture, IsTheSameBitForBitFromEveryTreeAndThreadCount) {
    const Scene scene = crowded_scene();
    Camera camera = from_above(0.5);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0.5, 3));
    const Picture expected = picture_of(tree_of(scene.mesh, "lbvh", 2), scene, camera, 48, 5, 1);
    EXPECT_GT(mean(expected), 0.1);
    for (const BuilderInfo& info : builders())
        for (unsigned branching : {2U, 4U, 8U})
            for (int threads : {1, 2}) {
                const Picture picture = picture_of(tree_of(scene.mesh, info.id, branching), scene,
                                                   camera, 48, 5, threads);
                EXPECT_EQ(picture.pixels, expected.pixels) << info.id << branching << threads;
                EXPECT_EQ(picture.rays, expected.rays);
            }
}

TEST(Picture, BatchesDoNotShow) {
    // 520 x 520 pixels are more than one batch; a pixel is the same as in a picture of one row of
    // batches.
    const Scene scene = scene_of(plane(), {lamp(LightKind::point, 100, {0, 0, 2})}, 0.5F);
    const Picture large = picture_of(scene, from_above(1.0), 520, 1);
    const Camera camera = from_above(1.0);
    for (const std::uint32_t pixel : {0U, 262143U, 262144U, 520U * 520U - 1}) {
        const CameraRay ray = camera_ray(camera, {520, 520, 3}, pixel, 0);
        const double squared = double(glm::dot(ray.origin, ray.origin)) - 25.0 + 4.0;
        const double expected =
            0.4 + 0.8 / pi * 100 / (4 * pi) / squared * 2.0 / std::sqrt(squared);
        EXPECT_NEAR(large.pixels[pixel].x, expected, 1e-4);
    }
}

TEST(Picture, CancelStopsIt) {
    const Scene scene = scene_of(plane(), {}, 1.0F);
    Token token;
    token.cancel();
    EXPECT_THROW(render(tree_of(scene.mesh), scene, from_above(1.0), {{64, 64}, 1, 0}, token),
                 Cancelled);
}

TEST(Picture, TreeOfAnotherMeshIsRefused) {
    const Scene scene = scene_of(plane(), {}, 1.0F);
    const Bvh other = tree_of(test::shared(plane()));
    EXPECT_THROW(picture_of(other, scene, from_above(1.0), 4, 1), std::invalid_argument);
}

// --- measured ray sets ---------------------------------------------------------------------------

struct Primary {
    RayArrays rays;
    Hits hits;
    PrimaryHits view() const { return {rays.directions, hits.u, hits.v, hits.triangle}; }
};

Primary trace_primary(const Scene& scene, const Camera& camera, std::uint32_t side) {
    Token token;
    Primary primary{camera_rays(camera, {side, side}, 0, 0, token), {}};
    const float t_min = 0.0F, t_max = std::numeric_limits<float>::infinity();
    primary.hits =
        trace(tree_of(scene.mesh),
              {primary.rays.origins, primary.rays.directions, {&t_min, 1}, {&t_max, 1}}, {}, token);
    return primary;
}

TEST(Secondary, OneRayForEachHitAndNoneForMisses) {
    const Scene scene = scene_of(test::sphere(8), {lamp(LightKind::point, 1, {0, 0, 4})}, 0.0F);
    const Primary primary = trace_primary(scene, from_above(1.5), 40);
    std::size_t hits = 0;
    for (const std::uint32_t triangle : primary.hits.triangle) hits += triangle != no_triangle;
    ASSERT_GT(hits, 400U);
    ASSERT_LT(hits, 1600U);
    const ShadowRays shadow = shadow_rays(scene, primary.view(), 0, 0, Token());
    ASSERT_EQ(shadow.rays.origins.size(), hits);
    for (std::size_t i = 0; i < hits; ++i) {
        EXPECT_EQ(shadow.t_max[i], shadow_reach);
        const glm::vec3 end = shadow.rays.origins[i] + shadow.rays.directions[i];
        EXPECT_NEAR(glm::length(end - glm::vec3(0, 0, 4)), 0.0F, 1e-5F);
    }
    EXPECT_EQ(diffuse_rays(scene, primary.view(), 0, 0, Token()).origins.size(), hits);
}

TEST(Secondary, RaysFromAConvexSolidMeetNothing) {
    const Scene scene = scene_of(test::sphere(24, glm::vec3(7, -5, 3)), {}, 1.0F);
    Camera camera = from_above(1.0);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(7, -5, 6));
    const Primary primary = trace_primary(scene, camera, 100);
    const RayArrays rays = diffuse_rays(scene, primary.view(), 9, 0, Token());
    const float t_min = 0.0F, t_max = std::numeric_limits<float>::infinity();
    Token token;
    TraceOptions any;
    any.any_hit = true;
    const Hits hits = trace(tree_of(scene.mesh),
                            {rays.origins, rays.directions, {&t_min, 1}, {&t_max, 1}}, any, token);
    std::size_t occluded = 0;
    for (const std::uint8_t hit : hits.occluded) occluded += hit;
    EXPECT_EQ(occluded, 0U);
}

TEST(Secondary, WithoutLightsShadowRaysGoToTheWorld) {
    const Scene scene = scene_of(plane(), {}, 1.0F);
    const Primary primary = trace_primary(scene, from_above(1.0), 64);
    const ShadowRays shadow = shadow_rays(scene, primary.view(), 0, 0, Token());
    double cosine = 0.0;
    for (std::size_t i = 0; i < 4096; ++i) {
        EXPECT_TRUE(std::isinf(shadow.t_max[i]));
        cosine += double(shadow.rays.directions[i].z) / 4096.0;
    }
    EXPECT_NEAR(cosine, 2.0 / 3.0, 0.01);
}

TEST(Secondary, SameSeedSameRaysAtAnyThreadCount) {
    const Scene scene = crowded_scene();
    Camera camera = from_above(0.5);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0.5, 3));
    const Primary primary = trace_primary(scene, camera, 64);
    const ShadowRays one = shadow_rays(scene, primary.view(), 5, 1, Token());
    const ShadowRays two = shadow_rays(scene, primary.view(), 5, 2, Token());
    EXPECT_EQ(one.rays.directions, two.rays.directions);
    EXPECT_EQ(one.rays.origins, two.rays.origins);
    EXPECT_EQ(one.t_max, two.t_max);
    EXPECT_NE(one.rays.directions,
              shadow_rays(scene, primary.view(), 6, 1, Token()).rays.directions);
}

}  // namespace
}  // namespace bvhlab
