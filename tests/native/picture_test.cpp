// SPDX-License-Identifier: GPL-3.0-or-later
// Direct light in closed form, and the same picture from every tree.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "pictures.h"

namespace bvhlab {
namespace {

using namespace test;
using std::numbers::pi;

constexpr PathSettings direct{.depth = 0, .shadow_rays = 2};

TEST(Picture, WhiteFurnaceIsOneEverywhere) {
    // A convex solid of albedo 1 in a world of radiance 1 cannot be seen, at any scale.
    for (const auto& [centre, radius] : {std::pair(glm::vec3(0.0F), 1.0F),
                                         {glm::vec3(300.0F, -200.0F, 100.0F), 1.0F},
                                         {glm::vec3(0.0F), 1e-6F}}) {
        const Scene scene = scene_of(test::sphere(12, centre, radius), {}, 1.0F, white);
        Camera camera = from_above(1.2 * radius);
        camera.to_world =
            glm::translate(glm::dmat4(1.0), glm::dvec3(centre) + glm::dvec3(0, 0, 3.0 * radius));
        for (const glm::vec3& pixel : picture_of(scene, camera, 32, {.samples = 4}).film.pixels)
            EXPECT_NEAR(pixel.x, 1.0F, 1e-6F);
    }
}

TEST(Picture, PointLightOnAPlaneFollowsLambertAndTheInverseSquare) {
    const Scene scene = scene_of(plane(), {lamp(LightKind::point, 100, {0, 0, 2})});
    const Picture picture = picture_of(scene, from_above(1.0), 3);
    const auto expected = [](double across) {
        const double squared = 4.0 + across * across;
        return 0.8 / pi * 100 / (4 * pi) / squared * 2.0 / std::sqrt(squared);
    };
    EXPECT_NEAR(picture.film.pixels[4].x, expected(0.0), 1e-5);
    EXPECT_NEAR(picture.film.pixels[5].x, expected(2.0 / 3.0), 1e-5);
    EXPECT_NEAR(picture.film.pixels[0].x, expected(std::sqrt(8.0) / 3.0), 1e-5);
}

TEST(Picture, EmissionIsSeenAndShinesOnItsSurroundings) {
    // An emitting square of half side h at height h: its form factor on the axis is
    // 4 / pi * sqrt(1/2) * atan(sqrt(1/2)).
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 100.0F);
    add_square(vertices, triangles, 6.0F, 6.0F);
    const auto mesh = test::shared(make_mesh(std::move(vertices), std::move(triangles)));
    const Scene scene = make_scene({mesh, {Material{}, diffuse(0.0F, 3.0F)}, {0, 0, 1, 1}});
    const double expected = 0.8 * 3.0 * 4.0 / pi * std::sqrt(0.5) * std::atan(std::sqrt(0.5));
    EXPECT_NEAR(mean(picture_of(scene, from_above(0.1), 4, {.samples = 1024, .paths = direct})),
                expected, 2e-3);
    Camera camera = from_above(0.1);
    camera.to_world = glm::rotate(camera.to_world, pi, glm::dvec3(1, 0, 0));
    EXPECT_EQ(mean(picture_of(scene, camera, 4, {.samples = 4})), 3.0);
}

TEST(Picture, OccludersCastShadowsAndThoseBehindTheLampDoNot) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 100.0F);
    add_square(vertices, triangles, 1.0F, 0.5F);
    const auto mesh = test::shared(make_mesh(std::move(vertices), std::move(triangles)));
    const auto scene = [&](double height) {
        return make_scene(
            {mesh, {Material{}}, {0, 0, 0, 0}, {lamp(LightKind::point, 100, {0, 0, height})}});
    };
    Camera camera = from_above(0.2);
    camera.clip_start = 4.5;  // between floor and square
    EXPECT_EQ(mean(picture_of(scene(2.0), camera, 8, {.paths = direct})), 0.0);
    EXPECT_GT(mean(picture_of(scene(0.9), camera, 8, {.paths = direct})), 1.0);
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
    const PictureOptions options{.samples = 4, .paths = direct};
    EXPECT_EQ(picture_of(open, camera, 16, options).film.pixels,
              picture_of(closed, camera, 16, options).film.pixels);
}

TEST(Picture, ManyLightsAreDrawnWithoutBias) {
    const Scene one = scene_of(plane(), {lamp(LightKind::point, 100, {0, 0, 2})});
    const Scene many =
        scene_of(plane(), std::vector<Light>(20, lamp(LightKind::point, 5, {0, 0, 2})));
    const Picture expected = picture_of(one, from_above(1.0), 4, {.paths = direct});
    const Picture drawn = picture_of(many, from_above(1.0), 4, {.paths = direct});
    for (std::size_t i = 0; i < 16; ++i)
        EXPECT_NEAR(drawn.film.pixels[i].x, expected.film.pixels[i].x, 1e-5);
}

TEST(Picture, OnlyTheRaysThatTheSceneNeedsAreTraced) {
    const auto rays = [](std::vector<Light> lights, float world, const PathSettings& paths) {
        return picture_of(scene_of(plane(), std::move(lights), world), from_above(1.0), 4,
                          {.paths = paths})
            .rays;
    };
    const Light above = lamp(LightKind::point, 1, {0, 0, 2}),
                below = lamp(LightKind::point, 1, {0, 0, -2});
    EXPECT_EQ(rays({}, 0.0F, direct), (RayCounts{.primary = 16}));
    EXPECT_EQ(rays({}, 1.0F, direct), (RayCounts{.primary = 16, .last = 16, .shadow = 32}));
    EXPECT_EQ(rays({above}, 0.0F, direct), (RayCounts{.primary = 16, .shadow = 32}));
    EXPECT_EQ(rays({below}, 0.0F, direct), (RayCounts{.primary = 16}));
    EXPECT_EQ(rays({above}, 0.0F, {.depth = 8, .shadow_rays = 1}),
              (RayCounts{.primary = 16, .secondary = 16, .shadow = 16}));
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
    return make_scene({test::shared(std::move(mesh)),
                       {Material{}, diffuse(0.3F, 4.0F)},
                       std::move(index),
                       std::move(lights),
                       {glm::vec3(0.2F)}});
}

TEST(Picture, IsTheSameBitForBitFromEveryTreeOrderThreadCountAndBatch) {
    const Scene scene = crowded_scene();
    Camera camera = from_above(0.5);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0.5, 3));
    PictureOptions options{.samples = 3, .paths = {.depth = 3, .shadow_rays = 2}, .threads = 1};
    const Picture expected = picture_of(tree_of(scene.mesh, "lbvh", 2), scene, camera, 20, options);
    EXPECT_GT(mean(expected), 0.1);
    unsigned turn = 0;
    Token token;
    for (const BuilderInfo& info : builders()) {
        const BinaryBvh binary = binary_tree_of(*scene.mesh, info.id);
        for (unsigned branching : {2U, 4U, 8U}) {
            options.threads = 1 + turn % 2;
            options.reorder = Reorder(turn % reorder_names.size());
            options.batch = turn % 7 == 0 ? 1 : 100 << turn % 7;
            ++turn;
            const Bvh bvh = collapse(binary, scene.mesh, branching, {}, token);
            const Picture picture = picture_of(bvh, scene, camera, 20, options);
            EXPECT_EQ(picture.film.pixels, expected.film.pixels) << info.id << branching;
            EXPECT_EQ(picture.rays, expected.rays);
        }
    }
}

TEST(Picture, TreeOfAnotherMeshIsRefused) {
    const Scene scene = scene_of(plane(), {}, 1.0F);
    const Bvh other = tree_of(test::shared(plane()));
    EXPECT_THROW(picture_of(other, scene, from_above(1.0), 4), std::invalid_argument);
}

}  // namespace
}  // namespace bvhlab
