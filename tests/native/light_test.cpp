// SPDX-License-Identifier: GPL-3.0-or-later
// Lights against their closed forms, and what is refused as a scene.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "meshes.h"
#include "render/light_sampling.h"
#include "render/sampler.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

constexpr std::uint32_t light_samples = 1 << 14;

/// Irradiance at the origin on a surface with this normal, averaged over samples.
double irradiance(const Light& light, const glm::dvec3& normal) {
    double sum = 0.0;
    for (std::uint32_t i = 0; i < light_samples; ++i) {
        const LightSample sample = sample_lamp(light, glm::dvec3(0.0), Sampler(0, i, 0).pair(0));
        const double cosine = glm::dot(normal, glm::normalize(sample.to_light));
        sum += sample.irradiance.x * std::max(0.0, cosine);
    }
    return sum / light_samples;
}

/// Irradiance of a polygon of radiance 1 (Lambert): half the sum of the angles under which its
/// edges are seen, each times the cosine of its plane. Corners counter-clockwise as seen from the
/// origin.
double polygon_irradiance(const std::vector<glm::dvec3>& corners, const glm::dvec3& normal) {
    double sum = 0.0;
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3 from = glm::normalize(corners[i]);
        const glm::dvec3 to = glm::normalize(corners[(i + 1) % corners.size()]);
        sum +=
            std::acos(glm::dot(from, to)) * glm::dot(normal, glm::normalize(glm::cross(from, to)));
    }
    return std::abs(0.5 * sum);
}

Light lamp(LightKind kind, double power, const glm::dvec3& place) {
    Light light;
    light.kind = kind;
    light.to_world = glm::translate(glm::dmat4(1.0), place);
    light.color = glm::vec3(float(power));
    return light;
}

const glm::dvec3 up(0, 0, 1);

TEST(Lights, PointFollowsTheInverseSquare) {
    const Light light = lamp(LightKind::point, 100, {0, 3, 4});
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / 25 * 0.8, 1e-6);
}

TEST(Lights, PointWithRadiusIsAFacingDisk) {
    Light light = lamp(LightKind::point, 100, {0, 0, 2});
    light.size_x = 0.5;
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / (4 + 0.25), 1e-4);
}

TEST(Lights, SunGivesItsStrengthAtAnyAngularSize) {
    for (double diameter : {0.0, 0.01, 0.8}) {
        Light light = lamp(LightKind::sun, 3, {5, 6, 7});
        light.size_x = diameter;
        light.to_world = glm::rotate(light.to_world, 0.5, glm::dvec3(1, 0, 0));
        EXPECT_NEAR(irradiance(light, up), 3 * std::cos(0.5), 2e-4) << diameter;
    }
}

TEST(Lights, SpotMasksAPointLight) {
    Light light = lamp(LightKind::spot, 100, {0, 0, 2});
    light.spot_angle = 1.0;
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / 4, 1e-6);
    light.to_world = glm::rotate(light.to_world, 0.49, glm::dvec3(1, 0, 0));
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / 4, 1e-6);
    light.to_world = glm::rotate(light.to_world, 0.02, glm::dvec3(1, 0, 0));
    EXPECT_EQ(irradiance(light, up), 0.0);
}

TEST(Lights, SpotBlendIsHalfInTheMiddleOfItsCosines) {
    Light light = lamp(LightKind::spot, 100, {0, 0, 2});
    light.spot_angle = 1.0;
    light.spot_blend = 0.5;
    const double edge = std::cos(0.5);
    const double middle = std::acos(edge + 0.25 * (1.0 - edge));
    light.to_world = glm::rotate(light.to_world, middle, glm::dvec3(1, 0, 0));
    EXPECT_NEAR(irradiance(light, up), 0.5 * 100 / (4 * pi) / 4, 1e-6);
}

TEST(Lights, DiskHasItsFormFactor) {
    Light light = lamp(LightKind::area, 100, {0, 0, 2});
    light.shape = LightShape::disk;
    light.size_x = light.size_y = 3.0;  // of diameter
    const double radiance = 100 / (pi * pi * 2.25);
    EXPECT_NEAR(irradiance(light, up), pi * radiance * 2.25 / (2.25 + 4), 5e-3);
}

TEST(Lights, RectangleHasItsFormFactorAndShinesForwardOnly) {
    Light light = lamp(LightKind::area, 100, {0.5, 0.2, 2});
    light.to_world = glm::rotate(light.to_world, 0.4, glm::dvec3(0, 1, 0));
    light.size_x = 2.0;
    light.size_y = 1.0;
    std::vector<glm::dvec3> corners;
    for (const glm::dvec2 place : {glm::dvec2(-1, -0.5), {1, -0.5}, {1, 0.5}, {-1, 0.5}})
        corners.emplace_back(light.to_world * glm::dvec4(place, 0.0, 1.0));
    const double expected = 100 / (2 * pi) * polygon_irradiance(corners, up);
    EXPECT_NEAR(irradiance(light, up), expected, 1e-3 * expected);
    light.to_world = glm::rotate(light.to_world, pi, glm::dvec3(0, 1, 0));
    EXPECT_EQ(irradiance(light, up), 0.0);
}

TEST(Lights, RectangleIsDrawnBySolidAngle) {
    // Directly above the middle of a large lamp, every sample counts the same; from anywhere,
    // points lie on the lamp and the mean of the directions by area agrees with that by solid
    // angle.
    Light light = lamp(LightKind::area, 1, {0, 0, 0.01});
    light.size_x = 4.0;
    light.size_y = 2.0;
    for (std::uint32_t i = 0; i < 256; ++i) {
        const LightSample sample = sample_lamp(light, {0, 0, 0}, Sampler(0, i, 0).pair(0));
        EXPECT_NEAR(sample.irradiance.x, 2 * pi / (8 * pi), 0.01);
        EXPECT_LE(std::abs(sample.to_light.x), 2.0);
        EXPECT_LE(std::abs(sample.to_light.y), 1.0);
        EXPECT_NEAR(sample.to_light.z, 0.01, 1e-12);
    }
    for (const glm::dvec3& position : {glm::dvec3(3, 0.5, -1), glm::dvec3(-1, -5, -3)}) {
        glm::dvec3 by_angle(0.0), by_area(0.0);
        for (std::uint32_t i = 0; i < light_samples; ++i) {
            const glm::dvec2 random = Sampler(0, i, 0).pair(0);
            const LightSample sample = sample_lamp(light, position, random);
            by_angle += sample.irradiance.x * glm::normalize(sample.to_light);
            const glm::dvec3 to_point =
                glm::dvec3((random.x - 0.5) * 4, (random.y - 0.5) * 2, 0.01) - position;
            const double distance = glm::length(to_point);
            by_area += to_point * (to_point.z / (pi * std::pow(distance, 4)));
        }
        EXPECT_NEAR(glm::length(by_angle - by_area) / glm::length(by_area), 0.0, 1e-3);
    }
}

Scene scene_of(Mesh mesh, std::vector<Material> materials, std::vector<Light> lights) {
    Array<std::uint32_t> index(mesh.size());
    for (std::size_t i = 0; i < index.size(); ++i) index[i] = std::uint32_t(i % materials.size());
    return make_scene(test::shared(std::move(mesh)), std::move(materials), std::move(index),
                      std::move(lights), glm::vec3(0.0F));
}

TEST(Lights, EmittingTrianglesHaveTheirFormFactorFromBothSides) {
    const Mesh mesh =
        make_mesh({{-1, -1, 2}, {1, -1, 2}, {1, 1, 2}, {-1, 1, 3}}, {{0, 1, 2}, {0, 2, 3}});
    const Scene scene = scene_of(mesh, {{glm::vec3(0.5F), glm::vec3(2.0F)}}, {});
    const LightSampler lights(scene);
    ASSERT_EQ(lights.size(), 1U);
    double sum = 0.0;
    for (std::uint32_t i = 0; i < light_samples; ++i) {
        const LightSample sample = lights.sample(0, glm::dvec3(0.0), Sampler(0, i, 0).pair(0));
        sum += sample.irradiance.x * sample.to_light.z / glm::length(sample.to_light);
    }
    double expected = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
        const Triangle t = mesh.triangle(i);
        expected +=
            2.0 * polygon_irradiance({glm::dvec3(t.a), glm::dvec3(t.b), glm::dvec3(t.c)}, up);
    }
    EXPECT_NEAR(sum / light_samples, expected, 2e-3 * expected);
}

TEST(Lights, ChoiceFollowsPower) {
    const Scene scene =
        scene_of(test::copies(1), {Material{}},
                 {lamp(LightKind::point, 10, {0, 0, 1}), lamp(LightKind::point, 0, {0, 0, 1}),
                  lamp(LightKind::area, 30, {0, 0, 1})});
    const LightSampler lights(scene);
    double probability;
    EXPECT_EQ(lights.choose(0.0, probability), 0U);
    EXPECT_NEAR(probability, 0.25, 1e-12);
    EXPECT_EQ(lights.choose(0.2499, probability), 0U);
    EXPECT_EQ(lights.choose(0.25, probability), 2U);
    EXPECT_NEAR(probability, 0.75, 1e-12);
    EXPECT_EQ(lights.choose(0.99999999, probability), 2U);
}

TEST(Lights, DarkLampsAreStillChosen) {
    const Scene scene =
        scene_of(test::copies(1), {Material{}},
                 {lamp(LightKind::point, 0, {0, 0, 1}), lamp(LightKind::point, 0, {0, 0, 1})});
    double probability;
    EXPECT_EQ(LightSampler(scene).choose(0.7, probability), 1U);
    EXPECT_EQ(probability, 0.5);
}

TEST(Scene, BadPartsAreNamed) {
    const auto mesh = test::shared(test::copies(3));
    const auto complaint = [&](Material material, Array<std::uint32_t> index, Light light) {
        try {
            make_scene(mesh, {material}, std::move(index), {light}, glm::vec3(0.0F));
        } catch (const std::invalid_argument& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    const Light good = lamp(LightKind::point, 1, {0, 0, 0});
    EXPECT_EQ(complaint({}, {0, 0, 0}, good), "");
    EXPECT_EQ(complaint({}, {0, 0, 1}, good),
              "triangle 2 has material 1, but there are only 1 materials");
    EXPECT_EQ(complaint({}, {0, 0}, good), "material_index has 2 entries for 3 triangles");
    EXPECT_NE(complaint({glm::vec3(2.0F), {}}, {0, 0, 0}, good).find("material 0 has base_color"),
              std::string::npos);
    Light bad = good;
    bad.color.y = -1.0F;
    EXPECT_EQ(complaint({}, {0, 0, 0}, bad).find("light 0: the light's color"), 0U);
}

}  // namespace
}  // namespace bvhlab
