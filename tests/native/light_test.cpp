// SPDX-License-Identifier: GPL-3.0-or-later
// Lights of a scene together: which is drawn, and with which density, against closed forms and
// against rays in all directions.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numbers>
#include <vector>

#include "meshes.h"
#include "render/light_sampling.h"
#include "render/sample_shapes.h"
#include "render/sampler.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

constexpr std::uint32_t light_samples = 1 << 14;
const glm::dvec3 up(0, 0, 1);
const glm::dvec3 origin(0.0);

Light lamp(LightKind kind, double power, const glm::dvec3& place) {
    Light light;
    light.kind = kind;
    light.to_world = glm::translate(glm::dmat4(1.0), place);
    light.color = glm::vec3(float(power));
    return light;
}

Material emitter(float radiance) {
    return {{}, {glm::vec3(radiance)}};
}

Material gloss() {
    Component component;
    component.model = Model::glossy;
    return {{component}, {}};
}

/// Two triangles above the origin, of which one faces it and the other does not.
Mesh two_triangles() {
    return make_mesh({{-1, -1, 2}, {1, -1, 2}, {1, 1, 2}, {-1, 1, 3}}, {{0, 1, 2}, {0, 3, 2}});
}

/// A scene of two_triangles() with these materials.
SceneParts parts(Material first, Material second) {
    SceneParts parts;
    parts.mesh = test::shared(two_triangles());
    parts.materials = {std::move(first), std::move(second)};
    parts.material_index = {0, 1};
    return parts;
}

LightSample draw(const LightSampler& lights, std::uint32_t i, std::uint32_t index = 0,
                 std::uint32_t count = 1) {
    const Sampler random(0, i, 0);
    return lights.sample(lights.odds(origin, up), origin, up, index, count, random.pair(1).x,
                         random.pair(0));
}

double cosine(const LightSample& sample) {
    return std::max(0.0, glm::dot(up, glm::normalize(sample.to_light)));
}

/// Unshadowed irradiance at the origin with `count` samples in a set.
double irradiance(const LightSampler& lights, std::uint32_t count) {
    double sum = 0.0;
    for (std::uint32_t i = 0; i < light_samples; ++i)
        for (std::uint32_t index = 0; index < count; ++index) {
            const LightSample sample = draw(lights, i, index, count);
            sum += sample.irradiance.x * cosine(sample);
        }
    return sum / (double(light_samples) * count);
}

/// Whether the triangle, alone in space, is met by a ray from the origin.
bool meets(const Triangle& triangle, const glm::dvec3& direction, double& distance, double& u,
           double& v) {
    const glm::dvec3 a(triangle.a), side(triangle.b - triangle.a), other(triangle.c - triangle.a);
    const glm::dvec3 p = glm::cross(direction, other);
    const double determinant = glm::dot(side, p);
    u = -glm::dot(a, p) / determinant;
    const glm::dvec3 q = glm::cross(-a, side);
    v = glm::dot(direction, q) / determinant;
    distance = glm::dot(other, q) / determinant;
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
}

double facing(const Triangle& triangle, const glm::dvec3& direction) {
    return glm::dot(
        glm::normalize(glm::dvec3(glm::cross(triangle.b - triangle.a, triangle.c - triangle.a))),
        direction);
}

/// All light from everywhere, in directions of the upper half, and the density with which light
/// samples find them.
struct Sky {
    double irradiance = 0.0, density = 0.0;
};

Sky look_everywhere(const Scene& scene, const LightSampler& lights, std::uint32_t directions) {
    Sky sky;
    const double solid_angle = 2.0 * pi / directions;
    const LightOdds odds = lights.odds(origin, up);
    for (std::uint32_t i = 0; i < directions; ++i) {
        const glm::dvec3 direction = sample_cone(up, 1.0, Sampler(0, i, 0).pair(0));
        double radiance = double(lights.world_radiance(direction).x);
        double density = lights.world_pdf(odds, up, direction);
        for (std::uint32_t triangle = 0; triangle < scene.mesh->size(); ++triangle) {
            double distance, u, v;
            const Triangle corners = scene.mesh->triangle(triangle);
            if (!meets(corners, direction, distance, u, v)) continue;
            radiance += double(scene.material(triangle).emission.value.x);
            density += lights.emitter_pdf(odds, triangle, distance, facing(corners, direction));
        }
        lights.for_lamps_met(
            origin, direction, 0.0, std::numeric_limits<double>::infinity(), [&] { return odds; },
            [&](const LampHit& hit) {
                radiance += hit.radiance.x;
                density += hit.pdf;
            });
        sky.irradiance += radiance * direction.z * solid_angle;
        sky.density += density * solid_angle;
    }
    return sky;
}

std::vector<Light> lamps_with_extent() {
    Light point = lamp(LightKind::point, 100, {1, 0.5, 2});
    point.size_x = 0.6;
    Light sun = lamp(LightKind::sun, 3, {0, 0, 0});
    sun.size_x = 0.5;
    sun.to_world = glm::rotate(sun.to_world, 0.6, glm::dvec3(0, 1, 0));
    Light area = lamp(LightKind::area, 40, {-1, 1, 1.5});
    area.size_x = 1.5;
    area.size_y = 1.0;
    return {point, sun, area};
}

TEST(Lights, AllTogetherBringWhatRaysInAllDirectionsFind) {
    SceneParts given = parts(emitter(5), emitter(1));
    given.materials[1].components = gloss().components;  // without which lamps are not met
    given.lights = lamps_with_extent();
    given.world.color = glm::vec3(0.7F);
    const Scene scene = make_scene(given);
    const LightSampler lights(scene);
    ASSERT_TRUE(lights.lamps_can_be_met());
    const Sky sky = look_everywhere(scene, lights, 1 << 17);
    EXPECT_NEAR(sky.density, 1.0, 2e-3);
    for (const std::uint32_t count : {1U, 2U, 3U})
        EXPECT_NEAR(irradiance(lights, count), sky.irradiance, 4e-3 * sky.irradiance) << count;
}

TEST(Lights, DensitiesOfDrawnDirectionsAreThoseOfMetOnes) {
    SceneParts given = parts(emitter(5), emitter(1));
    given.world.color = glm::vec3(0.7F);
    const Scene scene = make_scene(given);
    const LightSampler lights(scene);
    const LightOdds odds = lights.odds(origin, up);
    int near = 0;
    for (std::uint32_t i = 0; i < 256; ++i) {
        const LightSample sample = draw(lights, i);
        const glm::dvec3 direction = glm::normalize(sample.to_light);
        if (sample.distant) {
            EXPECT_NEAR(sample.pdf, lights.world_pdf(odds, up, direction), 1e-9 * sample.pdf);
            continue;
        }
        ++near;
        double found = 0.0;
        for (std::uint32_t triangle = 0; triangle < 2; ++triangle) {
            double distance, u, v;
            const Triangle corners = scene.mesh->triangle(triangle);
            // Both may be met, of which the sample is on one.
            if (!meets(corners, direction, distance, u, v)) continue;
            if (std::abs(distance - glm::length(sample.to_light)) > 1e-4) continue;
            found = lights.emitter_pdf(odds, triangle, distance, facing(corners, direction));
        }
        EXPECT_NEAR(found, sample.pdf, 1e-4 * sample.pdf);
    }
    EXPECT_GT(near, 16);
    EXPECT_LT(near, 240);
}

/// How often each light is drawn at the origin, as a share.
std::vector<double> shares(const std::vector<Light>& lights, const glm::dvec3& normal,
                           const Material& material = {}) {
    SceneParts given = parts(material, material);
    given.lights = lights;
    const Scene scene = make_scene(given);
    const LightSampler sampler(scene);
    const LightOdds odds = sampler.odds(origin, normal);
    std::vector<double> found(lights.size(), 0.0);
    for (std::uint32_t i = 0; i < 1024 && !odds.empty(); ++i) {
        const LightSample sample =
            sampler.sample(odds, origin, normal, 0, 1, i / 1024.0, {0.5, 0.5});
        for (std::size_t k = 0; k < lights.size(); ++k) {
            const bool sun = lights[k].kind == LightKind::sun;
            const glm::dvec3 place(lights[k].to_world[sun ? 2 : 3]);
            // Shadow rays end a little before lamps.
            if (sample.distant == sun && glm::distance(sample.to_light, place) < 1e-4)
                found[k] += 1.0 / 1024.0;
        }
    }
    return found;
}

TEST(Lights, ChoiceFollowsThePowerThatArrives) {
    const Light point = lamp(LightKind::point, 10, {0, 0, 1});
    // 30 W twice as far away bring 30 / 4, of which half at a cosine of 0.5.
    const Light other = lamp(LightKind::point, 30, {0, 2 * std::sqrt(0.75), 1});
    EXPECT_NEAR(shares({point, other}, up)[1], 3.75 / 13.75, 2e-3);
    // Area lamps send more along their axis: P / pi, where points send P / (4 pi).
    Light area = lamp(LightKind::area, 10, {0, 0, 2});
    area.size_x = area.size_y = 1e-3;
    EXPECT_NEAR(shares({point, area}, up)[1], 0.5, 2e-3);
    area.to_world = glm::rotate(area.to_world, pi, glm::dvec3(1, 0, 0));
    EXPECT_EQ(shares({point, area}, up)[1], 0.0);  // shines away
    // A sun of 1 W/m2 is as bright as 4 pi W at a distance of 1.
    const Light sun = lamp(LightKind::sun, 10 / (4 * pi), {0, 0, 0});
    EXPECT_NEAR(shares({point, sun}, up)[1], 0.5, 2e-3);
    Light spot = lamp(LightKind::spot, 10, {0, 0, 1});
    spot.spot_angle = 1.0;
    EXPECT_NEAR(shares({other, spot}, up)[1], 10 / 13.75, 2e-3);
    spot.to_world = glm::rotate(spot.to_world, 1.0, glm::dvec3(1, 0, 0));
    EXPECT_EQ(shares({other, spot}, up)[1], 0.0);
    EXPECT_EQ(shares({point, lamp(LightKind::point, 0, {2, 0, 1})}, up)[1], 0.0);
}

TEST(Lights, WhatIsBehindASurfaceIsLeftOutUnlessLightGoesThrough) {
    const std::vector<Light> lights{lamp(LightKind::point, 10, {0, 0, 1}),
                                    lamp(LightKind::point, 10, {0, 1e-9, -1})};
    EXPECT_EQ(shares(lights, up), (std::vector<double>{1.0, 0.0}));
    EXPECT_EQ(shares({lights[1]}, up), std::vector<double>{0.0});
    Component thin;
    thin.model = Model::translucent;
    EXPECT_NEAR(shares(lights, up, {{thin}, {}})[1], 0.5, 2e-3);
}

TEST(Lights, NoLampThatBringsLightIsLeftOut) {
    std::vector<Light> lights = lamps_with_extent();
    Light spot = lamp(LightKind::spot, 10, {0.2, 0.1, 1});
    spot.spot_angle = 1.0;
    for (const double radius : {0.0, 0.5}) {
        spot.size_x = radius;
        lights.push_back(spot);
    }
    Light disk = lights[2];
    disk.shape = LightShape::disk;
    disk.to_world[0] += 0.5 * disk.to_world[1];  // sheared
    lights.push_back(disk);
    int lit = 0;
    for (std::uint32_t i = 0; i < 1 << 14; ++i) {
        const Sampler random(0, i, 0);
        const glm::dvec3 position(4.0 * random.pair(0) - 2.0, 4.0 * random.pair(1).x - 2.0);
        const glm::dvec3 normal = sample_cone(up, 2.0, random.pair(2));
        for (const Light& light : lights) {
            const Lamp seen(light);
            const LightSample sample = seen.sample(position, random.pair(3));
            if (sample.irradiance.x * glm::dot(normal, sample.to_light) <= 0.0) continue;
            ++lit;
            EXPECT_GT(seen.brightness(position, normal), 0.0);
            EXPECT_GT(seen.brightness(position, glm::dvec3(0.0)), 0.0);
        }
    }
    EXPECT_GT(lit, 10000);
}

TEST(Lights, ManyLampsAreDrawnByPowerAndShareWithDistantLights) {
    std::vector<Light> lights;
    for (int i = 0; i < 20; ++i) lights.push_back(lamp(LightKind::point, 1 + i, {1 + i, 0, 1}));
    lights.push_back(lamp(LightKind::sun, 5, {0, 0, 0}));
    const std::vector<double> found = shares(lights, up);
    for (std::size_t i = 0; i < 20; ++i)
        EXPECT_NEAR(found[i], 0.5 * double(1 + i) / 210.0, 2e-3) << i;
    EXPECT_NEAR(found[20], 0.5, 2e-3);
}

TEST(Lights, WhereNothingShinesThereIsNothingToSample) {
    SceneParts given = parts(Material{}, emitter(0));
    given.lights = {lamp(LightKind::point, 0, {0, 0, 1}), lamp(LightKind::sun, 0, {0, 0, 1})};
    EXPECT_TRUE(LightSampler(make_scene(given)).empty());
    given.lights.push_back(lamp(LightKind::sun, 1, {0, 0, 1}));
    EXPECT_FALSE(LightSampler(make_scene(given)).empty());
}

TEST(Lights, LampsAreMetOnlyWhereSomethingIsGlossy) {
    SceneParts given = parts(Material{}, Material{});
    given.lights = lamps_with_extent();
    const Scene matte = make_scene(given);
    EXPECT_FALSE(LightSampler(matte).lamps_can_be_met());
    EXPECT_EQ(draw(LightSampler(matte), 0).pdf, 0.0);
    given.materials[1] = gloss();
    const Scene glossy = make_scene(given);
    EXPECT_TRUE(LightSampler(glossy).lamps_can_be_met());
    EXPECT_GT(draw(LightSampler(glossy), 0).pdf, 0.0);
}

TEST(Lights, TinyAndHugeScenesHaveTheSameIrradiance) {
    double expected = 0.0;
    for (const float scale : {1.0F, 1e-6F, 1e6F}) {
        SceneParts given = parts(emitter(5), emitter(1));
        given.mesh = test::shared(test::scaled(two_triangles(), scale));
        const Scene scene = make_scene(given);
        const double found = irradiance(LightSampler(scene), 1);
        if (scale == 1.0F) expected = found;
        EXPECT_NEAR(found, expected, 1e-5 * expected) << scale;
    }
}

TEST(Lights, TexturedEmissionIsLookedUpAtThePoint) {
    auto texture = std::make_shared<Texture>();
    texture->width = texture->height = 2;
    texture->channels = 1;
    texture->closest = true;
    texture->floats = {8.0F, 0.0F, 0.5F, 1.0F};
    SceneParts given = parts(emitter(0), emitter(0));
    given.materials[0].emission.lookup = 0;
    given.lookups.push_back({.texture = 0, .scale = glm::vec3(2.0F)});
    given.textures.push_back(texture);
    given.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 0}, {1, 1}};
    const Scene scene = make_scene(given);
    const LightSampler lights(scene);
    double expected = 0.0;
    constexpr std::uint32_t directions = 1 << 17;
    for (std::uint32_t i = 0; i < directions; ++i) {
        const glm::dvec3 direction = sample_cone(up, 1.0, Sampler(0, i, 0).pair(0));
        double distance, u, v;
        if (!meets(scene.mesh->triangle(0), direction, distance, u, v)) continue;
        const glm::vec2 uv(u + v, v);
        expected += 2.0 * double(look_up(*texture, uv).x) * direction.z * 2.0 * pi / directions;
    }
    EXPECT_NEAR(irradiance(lights, 1), expected, 5e-3 * expected);
    EXPECT_EQ(lights.emitter_pdf(lights.odds(origin, up), 1, 2.0, 1.0), 0.0);
}

TEST(Lights, ManyEmittersAreDrawnByPower) {
    SceneParts given;
    given.mesh = test::shared(test::random_soup(20000));
    given.materials = {Material{}, emitter(2), emitter(6)};
    given.material_index = Array<std::uint32_t>(given.mesh->size(), 0);
    glm::dvec3 centre(0.0);
    double power = 0.0;
    for (std::uint32_t i = 0; i < given.mesh->size(); ++i) {
        given.material_index[i] = i % 3;
        const Triangle t = given.mesh->triangle(i);
        const double weight = double(glm::length(glm::cross(t.b - t.a, t.c - t.a))) *
                              double(given.materials[i % 3].emission.value.x);
        centre += weight * glm::dvec3(t.a + t.b + t.c) / 3.0;
        power += weight;
    }
    const Scene scene = make_scene(given);
    const LightSampler lights(scene);
    glm::dvec3 found(0.0);
    for (std::uint32_t i = 0; i < light_samples; ++i)
        found += draw(lights, i).to_light / double(light_samples);
    EXPECT_LT(glm::length(found - centre / power), 0.01);
}

}  // namespace
}  // namespace bvhlab
