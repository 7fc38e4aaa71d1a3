// SPDX-License-Identifier: GPL-3.0-or-later
// What a hit's barycentrics give: texture coordinates, smooth normals, and where shadow rays start.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>

#include "meshes.h"
#include "reference/brute_force.h"
#include "render/interpolate.h"
#include "render/terminator.h"

namespace bvhlab {
namespace {

SceneParts parts_of(Mesh mesh) {
    SceneParts parts;
    parts.mesh = test::shared(std::move(mesh));
    parts.materials = {Material{}};
    parts.material_index = Array<std::uint32_t>(parts.mesh->size(), 0);
    return parts;
}

Scene one_triangle(Array<glm::vec3> normals) {
    SceneParts parts = parts_of(test::copies(1));
    parts.normals = std::move(normals);
    return make_scene(std::move(parts));
}

/// A sphere of 2 * 6 * 12 triangles that is shaded as if it were round.
Scene smooth_sphere(float radius, const glm::vec3& centre) {
    SceneParts parts = parts_of(test::sphere(6, centre, radius));
    for (std::size_t i = 0; i < parts.mesh->size(); ++i) {
        const Triangle triangle = parts.mesh->triangle(i);
        // Degenerate triangles at the poles included: their corners have normals too.
        for (const glm::vec3& corner : {triangle.a, triangle.b, triangle.c})
            parts.normals.push_back(glm::normalize(corner - centre));
    }
    return make_scene(std::move(parts));
}

TEST(Interpolate, CoordinatesAreLinear) {
    SceneParts parts = parts_of(test::copies(2));
    parts.materials[0].emission.lookup = 0;  // or they are not kept
    parts.lookups = {{}};
    auto texture = std::make_shared<Texture>();
    texture->channels = 1;
    texture->floats = {1.0F};
    parts.textures = {texture};
    parts.uvs = {{9, 9}, {9, 9}, {9, 9}, {0, 1}, {2, 1}, {0, 5}};
    const Scene scene = make_scene(parts);
    EXPECT_EQ(uv_at(scene, 1, 0.0F, 0.0F), glm::vec2(0, 1));
    EXPECT_EQ(uv_at(scene, 1, 1.0F, 0.0F), glm::vec2(2, 1));
    EXPECT_EQ(uv_at(scene, 1, 0.5F, 0.25F), glm::vec2(1, 2));
}

TEST(Interpolate, NormalsTurnWithTheViewersSide) {
    const glm::vec3 tilted = glm::normalize(glm::vec3(1, 0, 1));
    const Scene scene = one_triangle({{0, 0, 1}, tilted, {0, 0, 1}});
    const Triangle triangle = scene.mesh->triangle(0);
    for (const double side : {1.0, -1.0}) {
        const SurfacePoint surface = surface_point(triangle, 0.5, 0.0, {0, 0, -side});
        const glm::vec3 normal = shading_normal(scene, 0, 0.5F, 0.0F, surface);
        const glm::vec3 expected = glm::normalize(glm::vec3(0, 0, 1) + tilted) * float(side);
        EXPECT_LT(glm::length(normal - expected), 1e-6F);
    }
}

TEST(Interpolate, CancellingNormalsFallBackToTheTriangles) {
    const Scene scene = one_triangle({{0, 1, 0}, {0, -1, 0}, {0, 0, 1}});
    const SurfacePoint surface = surface_point(scene.mesh->triangle(0), 0.5, 0.0, {0, 0, 1});
    EXPECT_EQ(shading_normal(scene, 0, 0.5F, 0.0F, surface), glm::vec3(0, 0, -1));
}

// --- shadow terminator ---------------------------------------------------------------------------

LightSample sun_in(const glm::dvec3& direction) {
    return {.to_light = direction, .distant = true};
}

TEST(Terminator, FlatTrianglesAreLeftAlone) {
    const Scene scene = one_triangle({{0, 0, 1}, {0, 0, 1}, {0, 0, 1}});
    const SurfacePoint surface = surface_point(scene.mesh->triangle(0), 0.2, 0.3, {0, 0, -1});
    for (const glm::dvec3& direction : {glm::dvec3(0.6, 0, 0.8), glm::dvec3(1, 0, 1e-3),
                                        glm::dvec3(1, 0, -1e-3), glm::dvec3(0, 0, -1)}) {
        const LightSample light = sun_in(glm::normalize(direction));
        const Ray smooth = smooth_shadow_ray(scene, 0, 0.2, 0.3, surface, {0, 0, 1}, light);
        const Ray flat = shadow_ray(surface, light);
        EXPECT_EQ(smooth.origin, flat.origin);
        EXPECT_EQ(smooth.direction, flat.direction);
    }
}

/// Rays from random points of a smooth sphere to a light, of those that the round sphere would
/// face; and for how many of them the triangle faces away.
struct Terminator {
    int lit = 0, all = 0, facing_away = 0, own_hits = 0;
};

Terminator shadows(float radius, const glm::vec3& centre, bool distant) {
    const Scene scene = smooth_sphere(radius, centre);
    std::mt19937 random(11);
    Array<glm::vec3> origins, directions;
    Array<float> t_max;
    Array<std::uint32_t> own;
    Array<bool> towards;
    Terminator found;
    while (origins.size() < 4000) {
        const auto triangle = std::uint32_t(random() % scene.mesh->size());
        const Triangle corners = scene.mesh->triangle(triangle);
        if (glm::length(glm::cross(corners.b - corners.a, corners.c - corners.a)) <
            1e-3F * radius * radius)
            continue;
        float u = test::uniform(random, 0, 1), v = test::uniform(random, 0, 1);
        if (u + v > 1.0F) u = 1.0F - u, v = 1.0F - v;
        const glm::dvec3 outside = glm::dvec3(corners.a - centre) / double(radius);
        const SurfacePoint surface = surface_point(corners, double(u), double(v), -outside);
        const glm::vec3 normal = shading_normal(scene, triangle, u, v, surface);
        LightSample light = sun_in(glm::normalize(glm::dvec3(0.3, -0.5, 0.8)));
        if (!distant) {
            light.distant = false;
            light.to_light =
                glm::dvec3(centre) + 5.0 * double(radius) * light.to_light - surface.position;
        }
        if (!(glm::dot(glm::dvec3(normal), light.to_light) > 0.0)) continue;
        const Ray ray =
            smooth_shadow_ray(scene, triangle, double(u), double(v), surface, normal, light);
        const bool faces = glm::dot(surface.normal, light.to_light) > 0.0;
        origins.push_back(ray.origin);
        directions.push_back(ray.direction);
        t_max.push_back(ray.t_max);
        own.push_back(triangle);
        towards.push_back(faces);
        found.facing_away += !faces;
    }
    const float t_min = 0.0F;
    Token token;
    const auto hits =
        brute_force(*scene.mesh, {origins, directions, {&t_min, 1}, t_max}, false, 1, token);
    for (std::size_t i = 0; i < origins.size(); ++i) {
        found.lit += hits.triangle[i] == no_triangle;
        found.own_hits += towards[i] && hits.triangle[i] == own[i];
        ++found.all;
    }
    return found;
}

TEST(Terminator, CoarseSmoothSpheresAreLitAsRoundOnes) {
    for (const bool distant : {true, false})
        for (const float scale : {1.0F, 1e-5F, 1e5F}) {
            const Terminator found = shadows(scale, scale * glm::vec3(3, -2, 1), distant);
            EXPECT_EQ(found.own_hits, 0);
            EXPECT_GT(found.facing_away, found.all / 50);  // all of which were black
            EXPECT_GT(found.lit, found.all * 0.995) << scale;
        }
}

TEST(Terminator, LightThroughTheSurfaceStartsBehindIt) {
    const Scene scene = smooth_sphere(1.0F, glm::vec3(0.0F));
    const Triangle corners = scene.mesh->triangle(40);
    const glm::dvec3 outside(glm::normalize(corners.a + corners.b + corners.c));
    const SurfacePoint surface = surface_point(corners, 0.3, 0.3, -outside);
    const glm::vec3 normal = shading_normal(scene, 40, 0.3F, 0.3F, surface);
    const Ray ray = smooth_shadow_ray(scene, 40, 0.3, 0.3, surface, normal, sun_in(-outside));
    EXPECT_LT(glm::dot(glm::dvec3(ray.origin) - surface.position, surface.normal), 0.0);
    EXPECT_LT(glm::length(glm::dvec3(ray.origin) - surface.position), 1e-5);
}

}  // namespace
}  // namespace bvhlab
