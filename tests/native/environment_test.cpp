// SPDX-License-Identifier: GPL-3.0-or-later
// Drawing by weight, and the textured background: what is drawn against what is looked up.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "meshes.h"
#include "render/environment.h"
#include "render/light_sampling.h"
#include "render/sample_shapes.h"
#include "render/sampler.h"
#include "scene/color.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

// --- distribution --------------------------------------------------------------------------------

TEST(Distribution, EvenNumbersGiveEachIndexItsShare) {
    std::mt19937 random(1);
    for (const std::size_t count : {1, 2, 15, 16, 17, 100}) {
        Array<float> weights(count);
        for (float& weight : weights)
            weight = std::max(0.0F, test::uniform(random, -1, 1)) *
                     std::pow(10.0F, test::uniform(random, -3, 3));
        weights.back() = 0.5F;
        const Distribution distribution(weights);
        constexpr std::uint32_t draws = 1 << 16;
        std::vector<double> shares(count);
        std::size_t last = 0;
        double last_rest = 0.0;
        for (std::uint32_t i = 0; i < draws; ++i) {
            const WeightedChoice choice = distribution.choose((i + 0.5) / draws);
            ASSERT_LT(choice.index, count);
            ASSERT_TRUE(choice.index > last || choice.rest >= last_rest);  // monotonic
            last = choice.index;
            last_rest = choice.rest;
            shares[last] += 1.0 / draws;
        }
        for (std::size_t i = 0; i < count; ++i) {
            EXPECT_NEAR(shares[i], distribution.probability(i), 1.0 / draws);
            EXPECT_TRUE(weights[i] > 0.0F || shares[i] == 0.0);
        }
    }
}

TEST(Distribution, EndsOfTheUnitIntervalAreDrawnToo) {
    const Distribution distribution(Array<float>{0, 0, 1e-30F, 3e38F, 0, 0});
    EXPECT_EQ(distribution.choose(0.0).index, 2U);
    EXPECT_EQ(distribution.choose(1.0 - 0x1p-53).index, 3U);
    EXPECT_LT(distribution.choose(1.0 - 0x1p-53).rest, 1.0);
}

// --- environment ---------------------------------------------------------------------------------

std::shared_ptr<Texture> random_texture(std::uint32_t width, std::uint32_t height) {
    auto texture = std::make_shared<Texture>();
    texture->width = width;
    texture->height = height;
    texture->channels = 3;
    std::mt19937 random(width * 100 + height);
    for (std::uint32_t i = 0; i < 3 * width * height; ++i)
        texture->floats.push_back(std::max(0.0F, test::uniform(random, -1, 1)));
    texture->floats[0] = 1.0F;
    return texture;
}

Scene scene_under(std::shared_ptr<const Texture> texture, glm::dmat3 to_texture = glm::dmat3(1.0)) {
    SceneParts parts;
    parts.mesh = test::shared(test::copies(1));
    parts.materials = {Material{}};
    parts.material_index = {0};
    parts.textures = {std::move(texture)};
    parts.world = {glm::vec3(0.5F, 1.0F, 2.0F), 0, to_texture};
    return make_scene(parts);
}

std::vector<std::shared_ptr<Texture>> textures() {
    std::vector<std::shared_ptr<Texture>> all;
    for (const glm::uvec2 size : {glm::uvec2(16, 8), {5, 3}, {1, 1}, {1, 4}, {7, 1}, {2, 2}})
        for (const Wrap wrap : {Wrap::repeat, Wrap::extend}) {
            all.push_back(random_texture(size.x, size.y));
            all.back()->wrap = wrap;
        }
    all.push_back(random_texture(16, 8));
    all.back()->closest = true;
    all.push_back(random_texture(64, 32));  // black but for one texel
    std::fill(all.back()->floats.begin(), all.back()->floats.end(), 0.0F);
    all.back()->floats[3 * (64 * 9 + 63)] = 1e5F;
    return all;
}

TEST(Environment, AxesLieWhereBlenderHasThem) {
    // Found with Cycles 5.0 and a texture of known texels.
    const auto expect_at = [](const glm::dvec3& direction, double u, double v) {
        const glm::dvec2 uv = equirectangular_from_direction(direction);
        EXPECT_NEAR(uv.x, u, 1e-12);
        EXPECT_NEAR(uv.y, v, 1e-12);
        EXPECT_LT(glm::length(direction_from_equirectangular(uv) - direction), 1e-12);
    };
    expect_at({1, 0, 0}, 0.5, 0.5);
    expect_at({0, 1, 0}, 0.25, 0.5);
    expect_at({0, -1, 0}, 0.75, 0.5);
    expect_at({-1, 1e-15, 0}, 0.0, 0.5);
    expect_at({std::sqrt(0.5), 0, std::sqrt(0.5)}, 0.5, 0.75);
    EXPECT_EQ(equirectangular_from_direction({0, 0, 1}).y, 1.0);
    EXPECT_EQ(equirectangular_from_direction({0, 0, -1}).y, 0.0);
}

TEST(Environment, DrawnDirectionsHaveTheDensityThatIsAsked) {
    const glm::dmat3 turned(glm::rotate(glm::dmat4(1.0), 0.7, glm::normalize(glm::dvec3(1, 2, 3))));
    for (const auto& texture : textures()) {
        const Scene scene = scene_under(texture, turned);
        const Environment environment(scene);
        for (std::uint32_t i = 0; i < 256; ++i) {
            const EnvironmentSample sample = environment.sample(Sampler(0, i, 0).pair(0));
            EXPECT_NEAR(glm::length(sample.direction), 1.0, 1e-12);
            const double pdf = environment.pdf(sample.direction);
            EXPECT_NEAR(pdf, sample.pdf, 1e-5 * sample.pdf);
            const glm::vec3 radiance = environment.radiance(sample.direction);
            EXPECT_LT(glm::length(radiance - sample.radiance),
                      1e-4F * glm::length(radiance) + 1e-5F);
        }
    }
}

/// Means over all directions.
struct Whole {
    double density = 0.0;  ///< times 4 pi
    glm::dvec3 flow{0.0};  ///< radiance times direction
    int lit_but_not_drawn = 0;
};

Whole look_everywhere(const Environment& environment, std::uint32_t directions) {
    Whole whole;
    for (std::uint32_t i = 0; i < directions; ++i) {
        const glm::dvec3 direction = sample_cone({0, 0, 1}, 2.0, Sampler(0, i, 0).pair(0));
        const double pdf = environment.pdf(direction);
        const glm::dvec3 radiance(environment.radiance(direction));
        whole.density += pdf * 4.0 * pi / directions;
        whole.flow += radiance.y * direction * (4.0 * pi / directions);
        whole.lit_but_not_drawn += pdf == 0.0 && luminance(radiance) > 1e-3;
    }
    return whole;
}

TEST(Environment, SamplesBringWhatAllDirectionsBring) {
    constexpr std::uint32_t count = 1 << 14;
    for (const auto& texture : textures()) {
        const Scene scene = scene_under(texture);
        const Environment environment(scene);
        const Whole whole = look_everywhere(environment, 4 * count);
        const double size = double(texture->width);
        EXPECT_NEAR(whole.density, 1.0, 5e-3) << size;
        EXPECT_EQ(whole.lit_but_not_drawn, 0) << size;
        glm::dvec3 flow(0.0);
        for (std::uint32_t i = 0; i < count; ++i) {
            const EnvironmentSample sample = environment.sample(Sampler(0, i, 0).pair(0));
            if (sample.pdf > 0.0)
                flow += double(sample.radiance.y) * sample.direction / (sample.pdf * count);
        }
        const double scale = environment.mean_luminance() * 4.0 * pi;
        EXPECT_LT(glm::length(flow - whole.flow), 1e-2 * scale) << size;
    }
}

TEST(Environment, ABrightTexelIsDrawnWithoutNoise) {
    const auto texture = textures().back();
    const Scene scene = scene_under(texture);
    const Environment environment(scene);
    double least = 1e30, most = 0.0;
    for (std::uint32_t i = 0; i < 1024; ++i) {
        const EnvironmentSample sample = environment.sample(Sampler(0, i, 0).pair(0));
        const double brought = double(sample.radiance.x) / sample.pdf;
        least = std::min(least, brought);
        most = std::max(most, brought);
    }
    EXPECT_LT(most, 1.2 * least);  // the sine of the latitude, over two texels of 32
}

TEST(Environment, BlackAndUnusableTexelsAreNotDrawn) {
    auto texture = random_texture(4, 2);
    std::fill(texture->floats.begin(), texture->floats.end(), 0.0F);
    const Scene black = scene_under(texture);
    EXPECT_EQ(Environment(black).mean_luminance(), 0.0);
    EXPECT_EQ(Environment(black).pdf({1, 0, 0}), 0.0);
    EXPECT_TRUE(LightSampler(black).empty());
    auto bad = std::make_shared<Texture>(*texture);
    bad->floats[0] = std::nanf("");
    bad->floats[3] = -5.0F;
    bad->floats[6] = 1.0F;
    const Scene scene = scene_under(bad);
    const Environment environment(scene);
    EXPECT_GT(environment.mean_luminance(), 0.0);
    for (std::uint32_t i = 0; i < 256; ++i) {
        const EnvironmentSample sample = environment.sample(Sampler(0, i, 0).pair(0));
        EXPECT_GE(sample.radiance.x, 0.0F);
        EXPECT_TRUE(std::isfinite(sample.pdf));
    }
}

TEST(Environment, ConstantWorldIsDrawnByTheCosine) {
    SceneParts parts;
    parts.mesh = test::shared(test::copies(1));
    parts.materials = {Material{}};
    parts.material_index = {0};
    parts.world.color = glm::vec3(2.0F);
    const Scene scene = make_scene(parts);
    const LightSampler lights(scene);
    const glm::dvec3 normal = glm::normalize(glm::dvec3(1, -2, 0.5));
    const LightOdds odds = lights.odds({1, 2, 3}, normal);
    for (std::uint32_t i = 0; i < 64; ++i) {
        const Sampler random(0, i, 0);
        const LightSample sample =
            lights.sample(odds, {1, 2, 3}, normal, 0, 1, random.pair(1).x, random.pair(0));
        EXPECT_TRUE(sample.distant);
        EXPECT_NEAR(sample.irradiance.x * glm::dot(sample.to_light, normal), 2.0 * pi, 1e-6);
        EXPECT_NEAR(sample.pdf, lights.world_pdf(odds, normal, sample.to_light), 1e-12);
    }
    EXPECT_EQ(lights.world_pdf(odds, normal, -normal), 0.0);
    EXPECT_EQ(lights.world_radiance(-normal), glm::vec3(2.0F));
}

}  // namespace
}  // namespace bvhlab
