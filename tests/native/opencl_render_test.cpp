// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures that a device renders against the CPU's, feature by feature; on PoCL in CI.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <thread>

#include "opencl/renderer.h"
#include "pictures.h"

namespace bvhlab {
namespace {

using namespace test;

std::shared_ptr<opencl::Device> device() {
    return opencl::Device::open("opencl");
}

Picture device_picture_of(const Bvh& bvh, const Scene& scene, const Camera& camera,
                          std::uint32_t side, const PictureOptions& options,
                          std::size_t work_group = 0) {
    Token token;
    const View view{bvh, scene, camera, {side, side, options.seed}};
    opencl::Renderer renderer(device(), view, nullptr, options.render(), token, work_group);
    renderer.render(options.samples, token);
    return renderer.picture();
}

// --- how near -----------------------------------------------------------------------------------

struct Difference {
    double unlike = 0.0;   ///< share of channels that have other bits
    double largest = 0.0;  ///< of a channel, relative to the mean of the picture
};

/// So near is a picture where no path has gone another way than the CPU's. What differs is the last
/// bit of sines, cosines and arc tangents (kernels/vector.cl), measured in all of these cases
/// together 6e-7; and a compiler's extra bits, where it keeps some on the host.
constexpr double rounding_bound = 2e-6;

Difference difference_of(const Array<glm::vec3>& ours, const Array<glm::vec3>& expected) {
    Difference difference;
    double mean = 0.0;
    for (const glm::vec3& pixel : expected) mean += double(pixel.x + pixel.y + pixel.z);
    mean /= 3.0 * double(expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i)
        for (int channel = 0; channel < 3; ++channel) {
            const double off = std::abs(double(ours[i][channel]) - double(expected[i][channel]));
            difference.largest = std::max(difference.largest, off / mean);
            difference.unlike += off != 0.0 ? 1.0 : 0.0;
        }
    difference.unlike /= 3.0 * double(expected.size());
    return difference;
}

// --- scenes -------------------------------------------------------------------------------------

Component component_of(Model model, float roughness, float color) {
    Component component;
    component.model = model;
    component.color.value = glm::vec3(color, 0.8F * color, 0.6F * color);
    component.roughness.value = roughness;
    return component;
}

Material material_of(Model model, float roughness, float color) {
    return {{component_of(model, roughness, color)}, {}};
}

/// One lamp of each kind, with extent, around the unit cube.
std::vector<Light> lamps_of_all_kinds() {
    std::vector<Light> lights;
    for (const LightKind kind :
         {LightKind::point, LightKind::sun, LightKind::spot, LightKind::area, LightKind::area}) {
        lights.push_back(lamp(kind, 5, {0.2, 0.4 + 0.2 * double(lights.size()), 2.0}));
        lights.back().size_x = lights.back().size_y = 0.3;
        lights.back().spot_blend = 0.5;
    }
    lights.back().shape = LightShape::disk;
    return lights;
}

/// Triangles in the unit cube over a floor, with these materials by turns; the last is the floor's.
SceneParts soup(std::vector<Material> materials, std::vector<Light> lights = {},
                float world = 0.0F) {
    Mesh mesh = random_soup(1000, 0.15F);
    add_square(mesh.vertices, mesh.triangles, -0.2F, 3.0F);
    Array<std::uint32_t> index(mesh.size());
    for (std::size_t i = 0; i < index.size(); ++i) index[i] = std::uint32_t(i % materials.size());
    index[index.size() - 1] = index[index.size() - 2] = std::uint32_t(materials.size() - 1);
    return {shared(make_mesh(std::move(mesh.vertices), std::move(mesh.triangles))),
            std::move(materials),
            std::move(index),
            std::move(lights),
            {glm::vec3(world)}};
}

Camera on_soup() {
    Camera camera;
    camera.to_world = glm::rotate(glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, -0.6, 2.0)), 0.5,
                                  glm::dvec3(1, 0, 0));
    camera.left = camera.bottom = -0.6;
    camera.right = camera.top = 0.6;
    return camera;
}

Texture noise(std::uint32_t width, std::uint32_t height, std::uint32_t channels, bool bytes,
              std::uint32_t seed) {
    Texture texture{width, height, channels, {}, {}};
    std::mt19937 random(seed);
    const std::size_t count = std::size_t(width) * height * channels;
    for (std::size_t i = 0; i < count; ++i) {
        if (bytes)
            texture.bytes.push_back(std::uint8_t(random() >> 24));
        else
            texture.floats.push_back(uniform(random, 0.0F, 1.0F));
    }
    return texture;
}

/// A texture of each kind of values and wrap, and a look-up of each that scales and turns it.
void add_textures(SceneParts& parts) {
    const Wrap wraps[] = {Wrap::repeat, Wrap::extend, Wrap::clip, Wrap::mirror};
    for (std::uint32_t i = 0; i < 8; ++i) {
        Texture texture = noise(5 + i, 3 + i, i % 3 == 0 ? 1 : i % 3 == 1 ? 3 : 4, i % 2 == 0, i);
        texture.srgb = i < 4;
        texture.closest = i == 5;
        texture.wrap = wraps[i % 4];
        parts.textures.push_back(std::make_shared<const Texture>(std::move(texture)));
        Lookup lookup{i, i % 2 ? Channel::rgb : Channel::luminance, glm::vec3(0.9F),
                      glm::vec3(0.05F)};
        lookup.mapping = glm::mat3x2(1.5F, 0.4F, -0.4F, 1.5F, 0.1F, -0.3F);
        parts.lookups.push_back(lookup);
    }
    std::mt19937 random(9);
    for (std::size_t i = 0; i < 3 * parts.mesh->size(); ++i) {
        const float u = uniform(random, -1.0F, 2.0F);
        parts.uvs.emplace_back(u, uniform(random, -1.0F, 2.0F));
    }
}

SceneParts textured() {
    std::vector<Material> materials;
    for (std::uint32_t i = 0; i < 8; ++i) {
        Material material = diffuse(0.5F, 0.0F);
        material.components[0].color.lookup = i;
        if (i == 3) material.emission.lookup = 1;
        materials.push_back(material);
    }
    SceneParts parts = soup(materials, {lamp(LightKind::point, 20, {0.5, 0.5, 2.0})}, 0.2F);
    add_textures(parts);
    return parts;
}

SceneParts smooth(SceneParts parts) {
    std::mt19937 random(5);
    std::normal_distribution<float> coordinate;
    for (std::size_t i = 0; i < 3 * parts.mesh->size(); ++i) {
        const float x = coordinate(random), y = coordinate(random);
        parts.normals.push_back(glm::normalize(glm::vec3(x, y, 3.0F)));
    }
    return parts;
}

SceneParts in_environment(SceneParts parts, bool bytes) {
    parts.world.texture = std::uint32_t(parts.textures.size());
    parts.world.color = glm::vec3(0.7F, 0.8F, 0.9F);
    parts.world.to_texture = glm::dmat3(glm::rotate(glm::dmat4(1.0), 0.7, glm::dvec3(0.6, 0, 0.8)));
    Texture texture = noise(40, 20, 3, bytes, 3);
    texture.srgb = bytes;
    texture.closest = bytes;
    parts.textures.push_back(std::make_shared<const Texture>(std::move(texture)));
    return parts;
}

/// Every model, from mirrors to rough.
std::vector<Material> glossy_materials() {
    std::vector<Material> materials;
    for (const Model model : {Model::principled, Model::glossy, Model::glass, Model::refraction,
                              Model::translucent, Model::diffuse})
        for (const float roughness : {0.0F, 0.05F, 0.6F})
            materials.push_back(material_of(model, roughness, 0.9F));
    for (Component mixed : {component_of(Model::principled, 0.3F, 0.8F)}) {
        mixed.weight.value = 0.7F;
        mixed.metallic.value = 0.4F;
        mixed.transmission.value = 0.5F;
        mixed.specular = 1.5F;
        Component mirror = component_of(Model::glossy, 0.0F, 0.9F);
        mirror.weight.value = 0.3F;
        materials.push_back({{mixed, mirror}, {}});
    }
    return materials;
}

std::vector<Material> veils() {
    Component clear = component_of(Model::transparent, 0.0F, 0.9F);
    clear.weight.value = 0.6F;
    Component rest = component_of(Model::diffuse, 0.0F, 0.7F);
    rest.weight.value = 0.4F;
    return {{{clear, rest}, {}},
            material_of(Model::transparent, 0.0F, 0.8F),
            diffuse(0.6F, 0.0F),
            diffuse(0.5F, 2.0F),
            diffuse(0.5F, 0.0F)};
}

/// Everything at once, with textures in every input.
SceneParts everything() {
    std::vector<Material> materials = glossy_materials();
    for (const Material& material : veils()) materials.push_back(material);
    materials.push_back(materials[0]);
    Component& component = materials.back().components[0];
    component.weight.lookup = component.roughness.lookup = component.metallic.lookup = 0;
    component.color.lookup = 1;
    component.transmission.lookup = 2;
    std::rotate(materials.begin(), materials.end() - 1, materials.end());
    SceneParts parts = soup(std::move(materials), lamps_of_all_kinds());
    add_textures(parts);
    return in_environment(smooth(std::move(parts)), false);
}

// --- the CPU's picture --------------------------------------------------------------------------

struct Case {
    const char* name;
    SceneParts (*parts)();
    double lens = 0.0;
    bool passes = false;
};

std::ostream& operator<<(std::ostream& stream, const Case& one) {
    return stream << one.name;
}

class OpenClPicture : public testing::TestWithParam<Case> {};

TEST_P(OpenClPicture, IsTheCpusWithinRounding) {
    const Case& one = GetParam();
    const Scene scene = make_scene(one.parts());
    const Bvh bvh = tree_of(scene.mesh);
    Camera camera = on_soup();
    camera.lens_radius = one.lens;
    camera.focus_distance = 1.5;
    const PictureOptions options{.samples = 4, .paths = {3, 2}, .passes = one.passes};
    constexpr std::uint32_t side = 32;
    const Picture expected = picture_of(bvh, scene, camera, side, options);
    const Picture ours = device_picture_of(bvh, scene, camera, side, options);
    EXPECT_GT(mean(expected), 0.01);
    const Difference difference = difference_of(ours.film.pixels, expected.film.pixels);
    std::printf("%s: %.2g%% of channels have other bits, by at most %.2g of the mean\n", one.name,
                100.0 * difference.unlike, difference.largest);
    EXPECT_LE(difference.unlike, 0.05);
    EXPECT_LE(difference.largest, rounding_bound);
    EXPECT_EQ(ours.rays, expected.rays);
    EXPECT_EQ(ours.samples, expected.samples);
    if (!one.passes) return;
    EXPECT_EQ(ours.film.normal, expected.film.normal);
    EXPECT_EQ(ours.film.albedo, expected.film.albedo);
    EXPECT_EQ(ours.film.depth, expected.film.depth);
    EXPECT_EQ(ours.film.node_visits, expected.film.node_visits);
    EXPECT_EQ(ours.film.triangle_tests, expected.film.triangle_tests);
}

SceneParts matt_with_lamps() {
    return soup({diffuse(0.7F, 0.0F), diffuse(0.4F, 0.0F)}, lamps_of_all_kinds(), 0.2F);
}
SceneParts matt_with_a_point() {
    return soup({diffuse(0.7F, 0.0F)}, {lamp(LightKind::point, 20, {0.5, 0.5, 2.0})});
}
SceneParts emitting() {
    return soup({diffuse(0.7F, 0.0F), diffuse(0.2F, 3.0F), diffuse(0.5F, 0.0F)});
}
SceneParts many_lamps() {
    std::vector<Light> lights;
    for (int i = 0; i < 30; ++i)
        lights.push_back(lamp(i % 5 ? LightKind::point : LightKind::sun, 1.0F + float(i),
                              {0.1 * i - 1.0, 0.3, 2.0}));
    return soup({diffuse(0.7F, 0.0F), diffuse(0.2F, 3.0F), material_of(Model::glossy, 0.4F, 0.9F)},
                std::move(lights), 0.1F);
}
SceneParts bright_sky() {
    return in_environment(soup({diffuse(0.7F, 0.0F)}), false);
}
SceneParts closest_sky() {
    return in_environment(soup({diffuse(0.7F, 0.0F)}), true);
}
SceneParts smooth_soup() {
    return smooth(matt_with_lamps());
}
SceneParts veiled() {
    return soup(veils(), {lamp(LightKind::point, 20, {0.5, 0.5, 2.0})}, 0.3F);
}
SceneParts glossy() {
    return soup(glossy_materials(), lamps_of_all_kinds(), 0.3F);
}

INSTANTIATE_TEST_SUITE_P(
    Features, OpenClPicture,
    testing::Values(Case{"point", matt_with_a_point}, Case{"lamps", matt_with_lamps},
                    Case{"lens", matt_with_a_point, 0.05, true}, Case{"emitters", emitting},
                    Case{"many_lamps", many_lamps}, Case{"textures", textured},
                    Case{"environment", bright_sky}, Case{"closest_environment", closest_sky},
                    Case{"smooth", smooth_soup}, Case{"transparency", veiled},
                    Case{"gloss", glossy}, Case{"everything", everything, 0.02, true}),
    [](const auto& test) { return std::string(test.param.name); });

// --- bit by bit ---------------------------------------------------------------------------------

TEST(OpenClRenderer, GivesTheSameBitsForAnyGroupBatchTreeOrderAndPortions) {
    const Scene scene = make_scene(veiled());
    const Camera camera = on_soup();
    PictureOptions options{.samples = 3, .passes = true};
    const Bvh bvh = tree_of(scene.mesh);
    const Picture expected = device_picture_of(bvh, scene, camera, 20, options);
    const auto same = [&](const Picture& picture) {
        return picture.film.pixels == expected.film.pixels &&
               picture.film.normal == expected.film.normal && picture.rays == expected.rays;
    };
    EXPECT_TRUE(same(device_picture_of(bvh, scene, camera, 20, options)));
    for (const std::size_t group : {3, 7})
        EXPECT_TRUE(same(device_picture_of(bvh, scene, camera, 20, options, group))) << group;
    options.batch = 100;
    options.reorder = Reorder(1);
    EXPECT_TRUE(same(device_picture_of(tree_of(scene.mesh, "sah", 2), scene, camera, 20, options)));

    Token token;
    opencl::Renderer renderer(device(), {bvh, scene, camera, {20, 20, options.seed}}, nullptr,
                              options.render(), token);
    for (int i = 0; i < 3; ++i) renderer.render(1, token);
    EXPECT_EQ(renderer.samples(), 3U);
    EXPECT_TRUE(same(renderer.picture()));
}

TEST(OpenClRenderer, CancelledItKeepsWhatItHasAndGoesOn) {
    const Scene scene = make_scene(matt_with_a_point());
    const Bvh bvh = tree_of(scene.mesh);
    const Camera camera = on_soup();
    PictureOptions options{.samples = 2, .batch = 20};
    Token token;
    opencl::Renderer renderer(device(), {bvh, scene, camera, {8, 8, options.seed}}, nullptr,
                              options.render(), token);
    renderer.render(1, token);
    token.cancel();
    EXPECT_THROW(renderer.render(1, token), Cancelled);
    EXPECT_EQ(renderer.samples(), 1U);
    Token fresh;
    renderer.render(1, fresh);
    EXPECT_EQ(renderer.picture().film.pixels,
              device_picture_of(bvh, scene, camera, 8, options).film.pixels);
}

TEST(OpenClRenderer, ShowsItsPictureWhileAnotherThreadRenders) {
    const Scene scene = make_scene(matt_with_a_point());
    const Bvh bvh = tree_of(scene.mesh);
    const Camera camera = on_soup();
    const PictureOptions options{.samples = 40};
    const Picture expected = device_picture_of(bvh, scene, camera, 24, options);
    Token token;
    opencl::Renderer renderer(device(), {bvh, scene, camera, {24, 24, options.seed}}, nullptr,
                              options.render(), token);
    std::thread thread([&] { renderer.render(options.samples, token); });
    Picture picture;
    do {
        picture = renderer.picture();
        EXPECT_LE(picture.samples, 40U);
        EXPECT_TRUE(std::isfinite(mean(picture)));
    } while (picture.samples < 40);
    thread.join();
    EXPECT_EQ(picture.film.pixels, expected.film.pixels);
}

TEST(OpenClRenderer, TellsTheTimeOfEachStage) {
    const Scene scene = make_scene(matt_with_a_point());
    const Picture picture =
        device_picture_of(tree_of(scene.mesh), scene, on_soup(), 32, {.samples = 2});
    for (const Stage stage : {Stage::generate, Stage::primary, Stage::secondary, Stage::shadow,
                              Stage::shade, Stage::compact, Stage::film})
        EXPECT_GT(picture.stages[std::size_t(stage)], 0.0) << stage_names[std::size_t(stage)];
    EXPECT_EQ(picture.stages[std::size_t(Stage::sort)], 0.0);
}

TEST(OpenClRenderer, TreeOfAnotherMeshIsRefused) {
    const Scene scene = make_scene(matt_with_a_point());
    const Bvh other = tree_of(shared(plane()));
    EXPECT_THROW(device_picture_of(other, scene, on_soup(), 4, {}), std::invalid_argument);
}

}  // namespace
}  // namespace bvhlab
