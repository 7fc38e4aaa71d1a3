// SPDX-License-Identifier: GPL-3.0-or-later
// Lamps against their closed forms, and drawing points of them against meeting them with rays.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "meshes.h"
#include "render/lamp.h"
#include "render/sample_shapes.h"
#include "render/sampler.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

constexpr std::uint32_t light_samples = 1 << 14;
const glm::dvec3 up(0, 0, 1);

glm::dvec2 random_pair(std::uint32_t index) {
    return Sampler(0, index, 0).pair(0);
}

/// Irradiance at the origin on a surface with this normal, averaged over samples.
double irradiance(const Light& light, const glm::dvec3& normal) {
    const Lamp lamp(light);
    double sum = 0.0;
    for (std::uint32_t i = 0; i < light_samples; ++i) {
        const LightSample sample = lamp.sample(glm::dvec3(0.0), random_pair(i));
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

// --- closed forms --------------------------------------------------------------------------------

TEST(Lamp, PointFollowsTheInverseSquare) {
    const Light light = lamp(LightKind::point, 100, {0, 3, 4});
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / 25 * 0.8, 1e-6);
}

TEST(Lamp, PointWithRadiusIsAFacingDisk) {
    Light light = lamp(LightKind::point, 100, {0, 0, 2});
    light.size_x = 0.5;
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / (4 + 0.25), 1e-4);
}

TEST(Lamp, SunGivesItsStrengthAtAnyAngularSize) {
    for (double diameter : {0.0, 0.01, 0.8}) {
        Light light = lamp(LightKind::sun, 3, {5, 6, 7});
        light.size_x = diameter;
        light.to_world = glm::rotate(light.to_world, 0.5, glm::dvec3(1, 0, 0));
        EXPECT_NEAR(irradiance(light, up), 3 * std::cos(0.5), 2e-4) << diameter;
    }
}

TEST(Lamp, SpotMasksAPointLight) {
    Light light = lamp(LightKind::spot, 100, {0, 0, 2});
    light.spot_angle = 1.0;
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / 4, 1e-6);
    light.to_world = glm::rotate(light.to_world, 0.49, glm::dvec3(1, 0, 0));
    EXPECT_NEAR(irradiance(light, up), 100 / (4 * pi) / 4, 1e-6);
    light.to_world = glm::rotate(light.to_world, 0.02, glm::dvec3(1, 0, 0));
    EXPECT_EQ(irradiance(light, up), 0.0);
}

TEST(Lamp, SpotBlendIsHalfInTheMiddleOfItsCosines) {
    Light light = lamp(LightKind::spot, 100, {0, 0, 2});
    light.spot_angle = 1.0;
    light.spot_blend = 0.5;
    const double edge = std::cos(0.5);
    const double middle = std::acos(edge + 0.25 * (1.0 - edge));
    light.to_world = glm::rotate(light.to_world, middle, glm::dvec3(1, 0, 0));
    EXPECT_NEAR(irradiance(light, up), 0.5 * 100 / (4 * pi) / 4, 1e-6);
}

TEST(Lamp, DiskHasItsFormFactor) {
    Light light = lamp(LightKind::area, 100, {0, 0, 2});
    light.shape = LightShape::disk;
    light.size_x = light.size_y = 3.0;  // of diameter
    const double radiance = 100 / (pi * pi * 2.25);
    EXPECT_NEAR(irradiance(light, up), pi * radiance * 2.25 / (2.25 + 4), 5e-3);
}

TEST(Lamp, RectangleHasItsFormFactorAndShinesForwardOnly) {
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

TEST(Lamp, RectangleIsDrawnBySolidAngle) {
    // Directly above the middle of a large lamp, every sample counts the same; from anywhere,
    // points lie on the lamp and the mean of the directions by area agrees with that by solid
    // angle.
    Light light = lamp(LightKind::area, 1, {0, 0, 0.01});
    light.size_x = 4.0;
    light.size_y = 2.0;
    const Lamp rectangle(light);
    for (std::uint32_t i = 0; i < 256; ++i) {
        const LightSample sample = rectangle.sample({0, 0, 0}, random_pair(i));
        EXPECT_NEAR(sample.irradiance.x, 2 * pi / (8 * pi), 0.01);
        EXPECT_LE(std::abs(sample.to_light.x), 2.0);
        EXPECT_LE(std::abs(sample.to_light.y), 1.0);
        EXPECT_NEAR(sample.to_light.z, 0.01, 1e-6);
        EXPECT_LT(sample.to_light.z, 0.01);  // shadow rays end before what lies in its plane
    }
    for (const glm::dvec3& position : {glm::dvec3(3, 0.5, -1), glm::dvec3(-1, -5, -3)}) {
        glm::dvec3 by_angle(0.0), by_area(0.0);
        for (std::uint32_t i = 0; i < light_samples; ++i) {
            const glm::dvec2 random = random_pair(i);
            const LightSample sample = rectangle.sample(position, random);
            by_angle += sample.irradiance.x * glm::normalize(sample.to_light);
            const glm::dvec3 to_point =
                glm::dvec3((random.x - 0.5) * 4, (random.y - 0.5) * 2, 0.01) - position;
            const double distance = glm::length(to_point);
            by_area += to_point * (to_point.z / (pi * std::pow(distance, 4)));
        }
        EXPECT_NEAR(glm::length(by_angle - by_area) / glm::length(by_area), 0.0, 1e-3);
    }
}

// --- drawing against meeting ---------------------------------------------------------------------

/// A lamp, and a cone of directions from the origin that holds all of it.
struct Sight {
    std::string name;
    Light light;
    glm::dvec3 axis;
    double sagitta;
};

std::vector<Sight> sights() {
    std::vector<Sight> all;
    const glm::dvec3 place(0.4, -0.3, 2);
    const auto add = [&](const char* name, LightKind kind, double size_x, double size_y,
                         double sagitta) -> Light& {
        Light light = lamp(kind, 50, place);
        light.size_x = size_x;
        light.size_y = size_y;
        all.push_back({name, light, glm::normalize(place), sagitta});
        return all.back().light;
    };
    add("point", LightKind::point, 0.5, 0, 0.1);
    add("large point", LightKind::point, 5, 0, 1);
    Light& spot = add("spot", LightKind::spot, 0.5, 0, 0.1);
    spot.spot_angle = 0.7;
    spot.spot_blend = 0.8;
    add("rectangle", LightKind::area, 2, 1, 0.3);
    add("small rectangle", LightKind::area, 0.02, 0.005, 1e-4);
    Light& sheared = add("sheared", LightKind::area, 1, 1, 0.2);
    sheared.to_world[1] = glm::normalize(glm::dvec4(0.5, 1, 0.3, 0));
    Light& ellipse = add("ellipse", LightKind::area, 2, 1, 0.3);
    ellipse.shape = LightShape::disk;
    ellipse.to_world = glm::rotate(ellipse.to_world, 0.5, glm::dvec3(1, 0.4, 0));
    Light& sun = add("sun", LightKind::sun, 0.7, 0, 0.08);
    sun.to_world[2] = glm::dvec4(all.back().axis, 0);
    Light& pale_sun = add("narrow sun", LightKind::sun, 0.009, 0, 2e-5);
    pale_sun.to_world[2] = glm::dvec4(all.back().axis, 0);
    return all;
}

TEST(Lamp, WhatIsDrawnIsMetWithTheSameDensity) {
    for (const Sight& sight : sights()) {
        const Lamp seen(sight.light);
        ASSERT_TRUE(seen.has_extent());
        for (std::uint32_t i = 0; i < 512; ++i) {
            const LightSample sample = seen.sample(glm::dvec3(0.0), random_pair(i));
            const double distance = glm::length(sample.to_light);
            // A hair towards the middle, as points of the edge may be on either side of it.
            const glm::dvec3 direction =
                glm::normalize(glm::mix(sample.to_light / distance, sight.axis, 1e-9));
            LampHit hit{};
            const bool met = seen.meet(glm::dvec3(0.0), direction, hit);
            if (sample.pdf == 0.0) {  // beyond a spot's cone
                EXPECT_FALSE(met) << sight.name << " " << i;
                continue;
            }
            ASSERT_TRUE(met) << sight.name << " " << i;
            EXPECT_NEAR(hit.pdf, sample.pdf, 1e-6 * sample.pdf) << sight.name;
            EXPECT_NEAR(hit.radiance.x, sample.irradiance.x * sample.pdf, 1e-6 * hit.radiance.x)
                << sight.name;
            if (sample.distant)
                EXPECT_TRUE(std::isinf(hit.distance));
            else
                EXPECT_NEAR(hit.distance, distance, 1e-6 * distance) << sight.name;
        }
    }
}

/// Share of samples that bring light: not those beyond a spot's cone.
double lit_share(const Lamp& lamp) {
    constexpr std::uint32_t count = 1 << 14;
    double lit = 0.0;
    for (std::uint32_t i = 0; i < count; ++i)
        lit += lamp.sample(glm::dvec3(0.0), random_pair(i)).pdf > 0.0 ? 1.0 / count : 0.0;
    return lit;
}

TEST(Lamp, DirectionsThatMeetItBringWhatPointsOfItBring) {
    constexpr std::uint32_t directions = 1 << 16;
    for (const Sight& sight : sights()) {
        const Lamp seen(sight.light);
        const double solid_angle = 2.0 * pi * sight.sagitta / directions;
        double density = 0.0, brought = 0.0;
        for (std::uint32_t i = 0; i < directions; ++i) {
            const glm::dvec3 direction = sample_cone(sight.axis, sight.sagitta, random_pair(i));
            LampHit hit{};
            if (!seen.meet(glm::dvec3(0.0), direction, hit)) continue;
            density += hit.pdf * solid_angle;
            brought += hit.radiance.x * std::max(0.0, direction.z) * solid_angle;
        }
        const double expected = irradiance(sight.light, up);
        const double lit = lit_share(seen);
        EXPECT_NEAR(density, lit, 4e-3) << sight.name;
        EXPECT_NEAR(brought, expected, 4e-3 * expected) << sight.name;
    }
}

TEST(Lamp, ScaleChangesUnitsOnly) {
    for (const Sight& sight : sights())
        for (const double scale : {1e-6, 1e6}) {
            Light scaled = sight.light;
            scaled.to_world[3] = glm::dvec4(glm::dvec3(scaled.to_world[3]) * scale, 1.0);
            if (scaled.kind != LightKind::sun) {
                scaled.size_x *= scale;
                scaled.size_y *= scale;
                scaled.color *= float(scale * scale);
            }
            const double expected = irradiance(sight.light, up);
            EXPECT_NEAR(irradiance(scaled, up), expected, 1e-6 * expected) << sight.name;
        }
}

TEST(Lamp, BehindItAndOffItsEdgeNothingIsMet) {
    Light light = lamp(LightKind::area, 1, {0, 0, 2});
    light.size_x = 2.0;
    light.size_y = 1.0;
    LampHit hit{};
    const Lamp rectangle(light);
    const auto meets = [&](const glm::dvec3& position, const glm::dvec3& to) {
        return rectangle.meet(position, glm::normalize(to - position), hit);
    };
    EXPECT_TRUE(meets({0, 0, 0}, {0.99, 0.49, 2}));
    EXPECT_FALSE(meets({0, 0, 0}, {1.01, 0.49, 2}));
    EXPECT_FALSE(meets({0, 0, 0}, {0.99, -0.51, 2}));
    EXPECT_FALSE(meets({0, 0, 4}, {0, 0, 2}));
    EXPECT_FALSE(meets({0, 0, 0}, {0, 0, -2}));
    light.shape = LightShape::disk;
    EXPECT_FALSE(Lamp(light).meet({0, 0, 0}, glm::normalize(glm::dvec3(0.9, 0.4, 2)), hit));
}

TEST(Lamp, WithoutExtentOnlyLightSamplingFindsIt) {
    for (const LightKind kind : {LightKind::point, LightKind::spot, LightKind::sun}) {
        const Lamp seen(lamp(kind, 1, {0, 0, 2}));
        EXPECT_FALSE(seen.has_extent());
        const LightSample sample = seen.sample(glm::dvec3(0.0), {0.5, 0.5});
        EXPECT_GT(sample.irradiance.x, 0.0);
        EXPECT_EQ(sample.pdf, 0.0);
    }
    // Seen from so far that float directions would not meet it.
    Light far = lamp(LightKind::point, 1, {0, 0, 1e9});
    far.size_x = 1.0;
    LampHit hit{};
    EXPECT_EQ(Lamp(far).sample(glm::dvec3(0.0), {0.5, 0.5}).pdf, 0.0);
    EXPECT_FALSE(Lamp(far).meet(glm::dvec3(0.0), up, hit));
}

TEST(Lamp, AwkwardPositionsGiveFiniteNumbers) {
    std::mt19937 random(3);
    for (const Sight& sight : sights()) {
        const Lamp seen(sight.light);
        const glm::dvec3 centre(sight.light.to_world[3]), edge(sight.light.to_world[0]);
        const glm::dvec3 normal(sight.light.to_world[2]);
        std::vector<glm::dvec3> positions{centre, centre + edge, centre + 3.0 * edge,
                                          centre + edge - 1e-9 * normal,
                                          centre + 1e3 * edge - 1e-6 * normal};
        for (int i = 0; i < 200; ++i) {
            const double height = std::pow(10.0, -double(i % 18));
            positions.push_back(centre + glm::dvec3(test::uniform_vector(random, -2, 2)) -
                                height * normal);
        }
        for (const glm::dvec3& position : positions)
            for (std::uint32_t i = 0; i < 4; ++i) {
                const LightSample sample = seen.sample(position, random_pair(i));
                const double sum = sample.irradiance.x + sample.pdf + sample.to_light.x +
                                   sample.to_light.y + sample.to_light.z;
                ASSERT_TRUE(std::isfinite(sum))
                    << sight.name << " at " << position.x << " " << position.y << " " << position.z;
                ASSERT_GE(sample.irradiance.x, 0.0);
                ASSERT_GE(sample.pdf, 0.0);
            }
    }
}

// --- bad input -----------------------------------------------------------------------------------

std::string complaint(const Light& light) {
    try {
        check_light(light);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(Lamp, BadLampsAreNamed) {
    Light light = lamp(LightKind::point, 1, {0, 0, 0});
    EXPECT_EQ(complaint(light), "");
    light.color.y = -1.0F;
    EXPECT_EQ(complaint(light),
              "the light's color is (1, -1, 1): it must be finite and not negative");
    light.color.y = std::nanf("");
    EXPECT_NE(complaint(light).find("must be finite"), std::string::npos);
    light = lamp(LightKind::area, 1, {0, 0, 0});
    light.size_x = 1.0;
    EXPECT_NE(complaint(light).find("no area"), std::string::npos);
    light.size_y = 1.0;
    EXPECT_EQ(complaint(light), "");
    light.to_world[1] = light.to_world[0];
    EXPECT_NE(complaint(light).find("no area"), std::string::npos);
}

}  // namespace
}  // namespace bvhlab
