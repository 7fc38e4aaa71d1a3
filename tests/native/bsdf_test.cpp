// SPDX-License-Identifier: GPL-3.0-or-later
// How surfaces scatter light: energy, densities, reciprocity, Snell's law, bad normals.
#include "render/bsdf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "meshes.h"

namespace bvhlab {
namespace {

using std::numbers::pi;
using AnyBsdf = Bsdf<false, true>;

const glm::vec3 up(0.0F, 0.0F, 1.0F);

Scene scene_of(std::vector<Component> components) {
    return make_scene({test::shared(test::copies(1)), {{std::move(components), {}}}, {0}});
}

Component component_of(Model model, float roughness, float color = 1.0F) {
    Component component;
    component.model = model;
    component.color.value = glm::vec3(color);
    component.roughness.value = roughness;
    return component;
}

Component principled(float roughness, float metallic, float transmission) {
    Component component = component_of(Model::principled, roughness);
    component.metallic.value = metallic;
    component.transmission.value = transmission;
    return component;
}

glm::vec3 at_angle(double degrees) {
    const double angle = degrees * pi / 180.0;
    return {float(std::sin(angle)), 0.0F, float(std::cos(angle))};
}

AnyBsdf bsdf_of(const Scene& scene, const glm::vec3& to_viewer, bool inside = false) {
    return {scene, 0, glm::vec2(0.0F), up, up, to_viewer, inside};
}

/// Sample `index` of a three-dimensional lattice of the plastic number's kind (M. Roberts 2018).
BsdfSample drawn(const AnyBsdf& bsdf, std::uint32_t index) {
    constexpr double g = 1.2207440846057596;  // g^4 = g + 1
    const auto part = [&](double step) {
        const double x = 0.5 + step * (index + 1.0);
        return float(x - std::floor(x));
    };
    return bsdf.sample({part(1.0 / g), part(1.0 / (g * g))}, part(1.0 / (g * g * g)));
}

/// Share of uniform light from everywhere that reaches the viewer.
double albedo_of(const AnyBsdf& bsdf, std::uint32_t samples) {
    double sum = 0.0;
    for (std::uint32_t i = 0; i < samples; ++i) sum += double(drawn(bsdf, i).weight.x);
    return sum / samples;
}

struct Surface {
    std::string name;
    Component component;
};

/// Each model and each extreme of the principled one, white.
std::vector<Surface> surfaces(float roughness) {
    return {{"diffuse", component_of(Model::diffuse, roughness)},
            {"glossy", component_of(Model::glossy, roughness)},
            {"glass", component_of(Model::glass, roughness)},
            {"refraction", component_of(Model::refraction, roughness)},
            {"translucent", component_of(Model::translucent, roughness)},
            {"coat", principled(roughness, 0.0F, 0.0F)},
            {"metal", principled(roughness, 1.0F, 0.0F)},
            {"mix", principled(roughness, 0.4F, 0.3F)}};
}

constexpr std::array roughnesses{0.0F, 0.05F, 0.2F, 0.5F, 0.8F, 1.0F};
constexpr std::array angles{0.0, 45.0, 75.0, 85.0};

// --- energy --------------------------------------------------------------------------------------

TEST(Bsdf, WhiteSurfacesLoseNoLight) {
    for (const float roughness : roughnesses)
        for (Surface& surface : surfaces(roughness))
            for (const float ior : {1.1F, 1.45F, 2.4F}) {
                if (ior != 1.45F && surface.name != "glass" && surface.name != "coat") continue;
                surface.component.ior = ior;
                const Scene scene = scene_of({surface.component});
                for (const double angle : angles)
                    EXPECT_NEAR(albedo_of(bsdf_of(scene, at_angle(angle)), 1U << 14), 1.0, 1.2e-3)
                        << surface.name << ", roughness " << roughness << ", ior " << ior << ", "
                        << angle << " degrees";
            }
}

TEST(Bsdf, WhiteGlassLosesNoLightFromInsideEither) {
    // Total reflection makes single values noisy, but not their mean.
    double mean = 0.0;
    for (const float roughness : roughnesses)
        for (const float ior : {1.1F, 1.45F, 2.4F}) {
            Component glass = component_of(Model::glass, roughness);
            glass.ior = ior;
            const Scene scene = scene_of({glass});
            for (const double angle : angles) {
                const double albedo = albedo_of(bsdf_of(scene, at_angle(angle), true), 1U << 16);
                EXPECT_NEAR(albedo, 1.0, 4e-3)
                    << "roughness " << roughness << ", ior " << ior << ", " << angle << " degrees";
                mean += albedo / double(roughnesses.size() * 3 * angles.size());
            }
        }
    EXPECT_NEAR(mean, 1.0, 5e-4);
}

TEST(Bsdf, ColoursAbsorb) {
    for (const float roughness : {0.0F, 0.3F, 1.0F})
        for (Surface& surface : surfaces(roughness)) {
            surface.component.color.value = glm::vec3(0.5F);
            const Scene scene = scene_of({surface.component});
            const double albedo = albedo_of(bsdf_of(scene, at_angle(30.0)), 1U << 12);
            EXPECT_LT(albedo, 0.8) << surface.name;
            EXPECT_GT(albedo, 0.2) << surface.name;
            if (surface.component.model != Model::principled &&
                surface.component.model != Model::glossy) {
                EXPECT_NEAR(albedo, 0.5, 2e-3) << surface.name;
            }
        }
}

TEST(Bsdf, WithoutCoatThePrincipledModelIsLambertian) {
    Component plain = principled(0.3F, 0.0F, 0.0F);
    plain.specular = 0.0F;
    plain.color.value = glm::vec3(0.2F, 0.5F, 0.9F);
    Component coated = plain;
    coated.specular = 1.0F;
    EXPECT_TRUE(is_lambertian(plain));
    EXPECT_FALSE(is_lambertian(coated));
    const Scene scene = scene_of({plain}), shiny = scene_of({coated});
    const glm::vec3 light = at_angle(-40.0);
    const Bsdf<false, false> lambert(scene, 0, glm::vec2(0.0F), up, up, at_angle(20.0), false);
    const BsdfValue value = bsdf_of(scene, at_angle(20.0)).evaluate(light);
    for (int channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(value.value[channel], lambert.evaluate(light).value[channel], 1e-6F);
    EXPECT_NEAR(value.pdf, light.z / float(pi), 1e-6F);
    EXPECT_NE(bsdf_of(shiny, at_angle(20.0)).evaluate(light).pdf, value.pdf);
}

// --- densities -----------------------------------------------------------------------------------

/// What a density or a set of samples looks like: its sum and the first moments.
using Moments = std::array<double, 7>;

void add_moments(Moments& moments, const glm::dvec3& direction, double weight) {
    const std::array<double, 7> terms{1.0,
                                      direction.x,
                                      direction.y,
                                      direction.z,
                                      direction.z * direction.z,
                                      direction.x * direction.z,
                                      std::abs(direction.z) * direction.x * direction.x};
    for (std::size_t i = 0; i < terms.size(); ++i) moments[i] += weight * terms[i];
}

TEST(Bsdf, SamplesFollowTheirDensityAndTheirWeightsTheValue) {
    constexpr std::uint32_t samples = 1U << 15;
    for (const float roughness : {0.3F, 0.7F})
        for (const Surface& surface : surfaces(roughness))
            for (const bool inside : {false, true}) {
                const Scene scene = scene_of({surface.component});
                const AnyBsdf bsdf = bsdf_of(scene, at_angle(50.0), inside);
                Moments sampled{}, integrated{};
                for (std::uint32_t i = 0; i < samples; ++i) {
                    const BsdfSample sample = drawn(bsdf, i);
                    if (sample.pdf == 0.0F) continue;
                    add_moments(sampled, glm::dvec3(sample.direction), 1.0 / samples);
                    const BsdfValue value = bsdf.evaluate(sample.direction);
                    EXPECT_NEAR(value.pdf, sample.pdf, 2e-3F * sample.pdf + 1e-5F) << surface.name;
                    EXPECT_NEAR(value.value.x, sample.weight.x * sample.pdf,
                                2e-3F * value.value.x + 1e-5F)
                        << surface.name;
                }
                constexpr int rows = 360, columns = 360;
                for (int row = 0; row < rows; ++row)
                    for (int column = 0; column < columns; ++column) {
                        const double theta = pi * (row + 0.5) / rows;
                        const double phi = 2.0 * pi * (column + 0.5) / columns;
                        const glm::dvec3 direction(std::sin(theta) * std::cos(phi),
                                                   std::sin(theta) * std::sin(phi),
                                                   std::cos(theta));
                        const double area = std::sin(theta) * 2.0 * pi * pi / (rows * columns);
                        add_moments(integrated, direction,
                                    area * double(bsdf.evaluate(glm::vec3(direction)).pdf));
                    }
                for (std::size_t i = 0; i < sampled.size(); ++i)
                    EXPECT_NEAR(sampled[i], integrated[i], 6e-3)
                        << surface.name << ", roughness " << roughness << ", moment " << i;
                EXPECT_LE(integrated[0], 1.0 + 2e-3);
            }
}

TEST(Bsdf, LambertianReflectionAndTranslucencyAreReciprocal) {
    for (const Model model : {Model::diffuse, Model::translucent}) {
        const Scene scene = scene_of({component_of(model, 0.0F, 0.7F)});
        const glm::vec3 a = at_angle(20.0);
        const glm::vec3 b = model == Model::diffuse ? at_angle(-65.0) : at_angle(110.0);
        const float forth = bsdf_of(scene, a).evaluate(b).value.x / std::abs(b.z);
        const glm::vec3 side(0.0F, 0.0F, b.z > 0.0F ? 1.0F : -1.0F);
        const AnyBsdf other(scene, 0, glm::vec2(0.0F), side, side, b, false);
        EXPECT_NEAR(forth, other.evaluate(a).value.x / a.z, 1e-6F);
        EXPECT_NEAR(forth, 0.7F / float(pi), 1e-6F);
    }
}

// --- delta lobes ---------------------------------------------------------------------------------

TEST(Bsdf, SmoothGlassFollowsSnellAndFresnel) {
    Component glass = component_of(Model::glass, 0.0F);
    glass.ior = 1.5F;
    const Scene scene = scene_of({glass});
    for (const bool inside : {false, true}) {
        const AnyBsdf bsdf = bsdf_of(scene, at_angle(30.0), inside);
        EXPECT_TRUE(bsdf.only_delta());
        EXPECT_EQ(bsdf.evaluate(at_angle(-30.0)).pdf, 0.0F);
        int reflected = 0;
        for (std::uint32_t i = 0; i < 10000; ++i) {
            const BsdfSample sample = drawn(bsdf, i);
            EXPECT_TRUE(sample.delta);
            EXPECT_EQ(sample.pdf, 0.0F);
            EXPECT_NEAR(sample.weight.x, 1.0F, 1e-6F);
            reflected += !sample.through;
            const float sine = sample.through ? (inside ? 0.75F : 1.0F / 3.0F) : 0.5F;
            EXPECT_NEAR(sample.direction.x, -sine, 1e-6F);
            EXPECT_EQ(sample.direction.z < 0.0F, sample.through);
        }
        // Fresnel's equations, written out for 30 degrees.
        const double n1 = inside ? 1.5 : 1.0, n2 = inside ? 1.0 : 1.5;
        const double c1 = std::cos(pi / 6.0), c2 = std::sqrt(1.0 - std::pow(n1 / n2 * 0.5, 2));
        const double s = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2);
        const double p = (n1 * c2 - n2 * c1) / (n1 * c2 + n2 * c1);
        EXPECT_NEAR(reflected / 10000.0, 0.5 * (s * s + p * p), 1e-3);
    }
    EXPECT_FALSE(drawn(bsdf_of(scene, at_angle(60.0), true), 3).through);  // total reflection
}

TEST(Bsdf, GlassOfIndexOneLetsLightStraightThrough) {
    for (const float roughness : {0.0F, 1.0F}) {
        Component glass = component_of(Model::glass, roughness);
        glass.ior = 1.0F;
        const Scene scene = scene_of({glass});
        const BsdfSample sample = drawn(bsdf_of(scene, at_angle(70.0)), 5);
        EXPECT_NEAR(glm::length(sample.direction + at_angle(70.0)), 0.0F, 1e-6F);
        EXPECT_EQ(sample.weight, glm::vec3(1.0F));
    }
}

// --- anything goes -------------------------------------------------------------------------------

TEST(Bsdf, RandomMaterialsNormalsAndDirectionsAreSane) {
    std::mt19937 generator(7);
    const auto random = [&] { return float(generator() >> 8) * 0x1p-24F; };
    const auto random_direction = [&] {
        const float z = 2.0F * random() - 1.0F, angle = 2.0F * pi_f * random();
        const float sine = std::sqrt(std::max(0.0F, 1.0F - z * z));
        return glm::vec3(sine * std::cos(angle), sine * std::sin(angle), z);
    };
    const auto edge = [&] { return random() < 0.2F ? 0.0F : random() < 0.2F ? 1.0F : random(); };
    const auto is_finite = [](const glm::vec3& v) { return std::isfinite(v.x + v.y + v.z); };
    for (int round = 0; round < 2000; ++round) {
        std::vector<Component> components;
        for (std::size_t i = 0; i < 1 + generator() % most_components; ++i) {
            Component component = component_of(Model(generator() % 7), edge());
            component.color.value = {edge(), edge(), edge()};
            component.weight.value = 0.25F * edge();
            component.metallic.value = edge();
            component.transmission.value = edge();
            component.ior = std::array{1.0F, 1.0005F, 1.33F, 10.0F}[generator() % 4];
            component.specular = std::array{0.0F, 1.0F, 2.0F}[generator() % 3];
            components.push_back(component);
        }
        const Scene scene = scene_of(components);
        const glm::vec3 geometric = random_direction();
        glm::vec3 viewer = random_direction();
        if (round % 4 == 0) viewer -= glm::dot(viewer, geometric) * geometric * 0.99999F;
        viewer = glm::normalize(viewer);
        if (glm::dot(viewer, geometric) < 0.0F) viewer = -viewer;
        glm::vec3 shading = random_direction();
        if (glm::dot(shading, geometric) < 0.0F) shading = -shading;
        const AnyBsdf bsdf(scene, 0, glm::vec2(0.0F), shading, geometric, viewer, round % 2 == 0);
        EXPECT_TRUE(is_finite(bsdf.albedo()));
        if (!bsdf.scatters()) continue;
        for (std::uint32_t i = 0; i < 20; ++i) {
            const BsdfValue value = bsdf.evaluate(random_direction());
            EXPECT_TRUE(is_finite(value.value) && value.pdf >= 0.0F && std::isfinite(value.pdf));
            EXPECT_GE(std::min({value.value.x, value.value.y, value.value.z}), 0.0F);
            const BsdfSample sample = bsdf.sample({edge(), edge()}, edge());
            EXPECT_NEAR(glm::length(sample.direction), 1.0F, 1e-5F);
            EXPECT_TRUE(is_finite(sample.weight) && std::isfinite(sample.pdf));
            EXPECT_GE(std::min({sample.weight.x, sample.weight.y, sample.weight.z}), 0.0F);
            EXPECT_LE(std::max({sample.weight.x, sample.weight.y, sample.weight.z}), 20.0F);
            if (sample.weight == glm::vec3(0.0F)) continue;
            const float side = glm::dot(sample.direction, geometric);
            EXPECT_TRUE(sample.through ? side < 0.0F : side > 0.0F);
        }
    }
}

// --- emission and transparency -------------------------------------------------------------------

TEST(Bsdf, TexturesDriveEmissionAndTransparency) {
    SceneParts parts{test::shared(test::copies(1)), {}, {0}};
    auto texture = std::make_shared<Texture>();
    texture->channels = 1;
    texture->floats = {0.5F};
    parts.textures = {texture};
    parts.uvs = {{0, 0}, {1, 0}, {0, 1}};
    parts.lookups = {{0, Channel::rgb, glm::vec3(4.0F), glm::vec3(0.0F)},
                     {0, Channel::red, glm::vec3(1.0F), glm::vec3(-0.2F)},
                     {0, Channel::rgb, glm::vec3(-4.0F), glm::vec3(0.0F)}};
    Component clear = component_of(Model::transparent, 0.0F, 0.5F);
    clear.weight.lookup = 1;
    parts.materials = {{{clear, component_of(Model::diffuse, 0.0F, 0.6F)}, {{}, 0}}, {{}, {{}, 2}}};
    const Scene scene = make_scene(parts);
    EXPECT_EQ(emission(scene, 0, glm::vec2(0.3F)), glm::vec3(2.0F));
    EXPECT_NEAR(straight_through(scene, 0, glm::vec2(0.3F)).x, 0.15F, 1e-6F);
    const Bsdf<true, false> bsdf(scene, 0, glm::vec2(0.3F), up, up, up, false);
    EXPECT_EQ(bsdf.albedo(), glm::vec3(0.6F));

    parts.material_index = {1};
    const Scene negative = make_scene(parts);
    EXPECT_EQ(emission(negative, 0, glm::vec2(0.3F)), glm::vec3(0.0F));
}

}  // namespace
}  // namespace bvhlab
