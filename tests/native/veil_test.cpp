// SPDX-License-Identifier: GPL-3.0-or-later
// Light straight through transparent surfaces, one behind the other.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pictures.h"

namespace bvhlab {
namespace {

using namespace test;
using std::numbers::pi;

/// Takes half of the light, by tint or by black threads.
Material veil(bool threads) {
    Component clear, black;
    clear.model = Model::transparent;
    clear.color.value = glm::vec3(threads ? 1.0F : 0.5F);
    clear.weight.value = threads ? 0.5F : 1.0F;
    black.color.value = glm::vec3(0.0F);
    black.weight.value = 0.5F;
    return threads ? Material{{clear, black}, {}} : Material{{clear}, {}};
}

/// A floor at height 0 below this many veils, which are out of the sight of from_above cameras that
/// start at height 1.
Scene veiled(int veils, bool threads, std::vector<Light> lights, float world) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    Array<std::uint32_t> index{0, 0};
    add_square(vertices, triangles, 0.0F, 1000.0F);
    for (int i = 0; i < veils; ++i) {
        add_square(vertices, triangles, 2.0F + 0.1F * float(i), 1000.0F);
        index.insert(index.end(), {1U, 1U});
    }
    return make_scene({test::shared(make_mesh(std::move(vertices), std::move(triangles))),
                       {diffuse(0.5F, 0.0F), veil(threads)},
                       std::move(index),
                       std::move(lights),
                       {glm::vec3(world)}});
}

TEST(PathTracer, EachVeilBeforeALampTakesHalfOfItsLight) {
    Camera camera = from_above(0.1);
    camera.clip_start = 4.0;
    const auto light = [&](int veils, bool threads) {
        const Scene scene = veiled(veils, threads, {lamp(LightKind::point, 100, {0, 0, 4})}, 0.0F);
        return mean(picture_of(scene, camera, 2, {.samples = 4, .paths = {0, 1}}));
    };
    const double open = light(0, false);
    EXPECT_GT(open, 0.01);
    for (const bool threads : {false, true})
        for (const int veils : {1, 2, 7})
            EXPECT_NEAR(light(veils, threads) / open, std::pow(0.5, veils), 1e-5);
}

TEST(PathTracer, EachVeilBeforeAnEmitterTakesHalfOfItsLight) {
    // A shadow ray that has passed a veil must still end before its emitter.
    Camera camera = from_above(0.5);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.123, 0.456, 5));
    camera.clip_start = 4.0;
    const auto light = [&](int veils, bool threads) {
        SceneParts parts = veiled(veils, threads, {}, 0.0F);
        Mesh mesh = *parts.mesh;
        const auto first = std::uint32_t(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(),
                             {{0.3F, 0.1F, 5.7F}, {1.3F, 0.2F, 6.1F}, {0.2F, 1.4F, 5.9F}});
        mesh.triangles.push_back({first, first + 1, first + 2});
        parts.mesh = test::shared(make_mesh(std::move(mesh.vertices), std::move(mesh.triangles)));
        parts.materials.push_back(diffuse(0.0F, 5.0F));
        parts.material_index.push_back(2);
        const Scene scene = make_scene(std::move(parts));
        return mean(picture_of(scene, camera, 32, {.samples = 4, .paths = {0, 1}}));
    };
    const double open = light(0, false);
    EXPECT_GT(open, 0.01);
    for (const bool threads : {false, true})
        for (const int veils : {1, 2, 7})
            EXPECT_NEAR(light(veils, threads) / open, std::pow(0.5, veils),
                        1e-3 * std::pow(0.5, veils));
}

TEST(PathTracer, EachVeilBeforeTheWorldTakesHalfOfItsLight) {
    Camera up = from_above(0.1);
    up.to_world =
        glm::rotate(glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1)), pi, glm::dvec3(1, 0, 0));
    Camera down = from_above(0.1);
    down.clip_start = 4.0;
    for (const bool threads : {false, true})
        for (const int veils : {1, 3}) {
            const Scene scene = veiled(veils, threads, {}, 1.0F);
            const double share = std::pow(0.5, veils);
            const PictureOptions options{.samples = 16, .paths = {0, 1}};
            EXPECT_NEAR(mean(picture_of(scene, up, 8, options)), share, 1e-6);
            EXPECT_NEAR(mean(picture_of(scene, down, 8, options)), 0.5 * share, 1e-3);
        }
}

TEST(PathTracer, ManyVeilsEnd) {
    const Scene scene = veiled(1100, false, {lamp(LightKind::point, 100, {0, 0, 900})}, 1.0F);
    Camera camera = from_above(0.1);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 300));
    const Picture picture = picture_of(scene, camera, 2);
    EXPECT_EQ(picture.rays.primary, 4U * (1 + most_layers));
    EXPECT_EQ(mean(picture), 0.0);
}

}  // namespace
}  // namespace bvhlab
