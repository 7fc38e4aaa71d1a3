// SPDX-License-Identifier: GPL-3.0-or-later
// Light that takes several bounces: closed forms, an independent path tracer, and rendering bit by
// bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "pictures.h"
#include "render/path_rays.h"

namespace bvhlab {
namespace {

using namespace test;
using std::numbers::pi;

// --- a slow and obvious path tracer --------------------------------------------------------------

/// Lambertian surfaces, emission and a constant world; no light sampling. All in double.
class NaiveTracer {
public:
    explicit NaiveTracer(const Scene& scene) : scene_(scene) {}

    double radiance(const glm::dvec3& origin, const glm::dvec3& direction, std::uint32_t bounces) {
        double nearest = std::numeric_limits<double>::infinity();
        std::uint32_t found = no_triangle;
        glm::dvec3 normal(0.0);
        for (std::uint32_t i = 0; i < scene_.mesh->size(); ++i) {
            const Triangle corners = scene_.mesh->triangle(i);
            const glm::dvec3 a(corners.a), ab = glm::dvec3(corners.b) - a,
                                           ac = glm::dvec3(corners.c) - a;
            const glm::dvec3 p = glm::cross(direction, ac), q = glm::cross(origin - a, ab);
            const double determinant = glm::dot(p, ab);
            const double u = glm::dot(p, origin - a) / determinant;
            const double v = glm::dot(q, direction) / determinant;
            const double t = glm::dot(q, ac) / determinant;
            if (u < 0.0 || v < 0.0 || u + v > 1.0 || t < 1e-9 || t >= nearest) continue;
            nearest = t;
            found = i;
            normal = glm::normalize(glm::cross(ab, ac));
        }
        if (found == no_triangle) return double(scene_.world.color.x);
        const Material& material = scene_.material(found);
        const double emitted = double(material.emission.value.x);
        if (bounces == 0) return emitted;
        if (glm::dot(normal, direction) > 0.0) normal = -normal;
        const glm::dvec3 next = glm::normalize(normal + on_sphere());  // density cos / pi
        return emitted + double(material.components[0].color.value.x) *
                             radiance(origin + nearest * direction, next, bounces - 1);
    }

private:
    glm::dvec3 on_sphere() {
        std::normal_distribution<double> normal;
        return glm::normalize(glm::dvec3(normal(random_), normal(random_), normal(random_)));
    }

    const Scene& scene_;
    std::mt19937_64 random_{1};
};

/// A floor, a wall, a slanted emitter and a roof with a gap to the world.
Scene nook() {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 1.0F);
    add_square(vertices, triangles, 1.5F, 0.6F);
    for (const glm::vec3 corner : {glm::vec3(1, -1, 0),
                                   {1, 1, 0},
                                   {1, 1, 2},
                                   {1, -1, 2},
                                   {-0.8, -0.5, 0.1},
                                   {-0.5, 0.5, 0.3},
                                   {-0.9, 0.5, 0.9}})
        vertices.push_back(corner);
    triangles.insert(triangles.end(), {{8, 9, 10}, {8, 10, 11}, {12, 13, 14}});
    return make_scene({test::shared(make_mesh(std::move(vertices), std::move(triangles))),
                       {diffuse(0.7F, 0.0F), diffuse(0.5F, 0.1F), diffuse(0.2F, 3.0F)},
                       {0, 0, 1, 1, 0, 0, 2},
                       {},
                       {glm::vec3(0.4F)}});
}

/// Looks straight down on the middle of the floor, from below the roof.
Camera below_roof() {
    Camera camera = from_above(0.5);
    camera.clip_start = 3.7;
    return camera;
}

TEST(PathTracer, AgreesWithANaiveOneAtEveryDepthAndWithAnyNumberOfLightSamples) {
    const Scene scene = nook();
    for (const std::uint32_t depth : {0U, 1U, 3U}) {
        NaiveTracer naive(scene);
        std::mt19937_64 random(7);
        std::uniform_real_distribution<double> place(-0.5, 0.5);
        constexpr int count = 20000;
        double sum = 0.0, squares = 0.0;
        for (int i = 0; i < count; ++i) {
            const double value =
                naive.radiance({place(random), place(random), 1.3}, {0, 0, -1}, depth + 1);
            sum += value;
            squares += value * value;
        }
        const double expected = sum / count;
        const double error = std::sqrt((squares / count - expected * expected) / count);
        EXPECT_LT(error, 0.015 * expected);
        for (const std::uint32_t shadow_rays : {0U, 1U, 2U, 5U}) {
            const double ours = mean(picture_of(scene, below_roof(), 32,
                                                {.samples = 16, .paths = {depth, shadow_rays}}));
            EXPECT_NEAR(ours, expected, 4.0 * error) << depth << " " << shadow_rays;
        }
    }
}

// --- closed forms --------------------------------------------------------------------------------

TEST(PathTracer, InsideAnEmittingSphereLightIsAGeometricSeries) {
    Mesh mesh = test::sphere(10);
    const Scene scene = scene_of(std::move(mesh), {}, 0.0F, diffuse(0.6F, 2.0F));
    Camera camera;
    for (const std::uint32_t depth : {0U, 1U, 8U})
        for (const std::uint32_t shadow_rays : {0U, 2U}) {
            double expected = 0.0;
            for (std::uint32_t i = 0; i < depth + 2; ++i) expected += 2.0 * std::pow(0.6, i);
            const double ours =
                mean(picture_of(scene, camera, 16, {.samples = 16, .paths = {depth, shadow_rays}}));
            EXPECT_NEAR(ours, expected, shadow_rays ? 2e-3 * expected : 1e-6) << depth;
        }
}

TEST(PathTracer, InsideAClosedBoxThatEmitsEverywhereLightIsUniform) {
    Array<glm::vec3> vertices;
    for (int i = 0; i < 8; ++i) vertices.push_back({i & 1, i >> 1 & 1, i >> 2});
    const Array<glm::uvec3> triangles{{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6},
                                      {0, 1, 5}, {0, 5, 4}, {2, 3, 7}, {2, 7, 6},
                                      {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
    const Scene scene =
        scene_of(make_mesh(std::move(vertices), triangles), {}, 0.0F, diffuse(0.5F, 1.0F));
    Camera camera;
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0.4, 0.7));
    const double ours = mean(picture_of(scene, camera, 24, {.samples = 16, .paths = {20, 1}}));
    EXPECT_NEAR(ours, 1.0 / (1.0 - 0.5), 4e-3);
}

// --- light samples against BSDF directions -------------------------------------------------------

Material of_model(Model model, float roughness, float color = 1.0F) {
    Component component;
    component.model = model;
    component.color.value = glm::vec3(color);
    component.roughness.value = roughness;
    return {{component}, {}};
}

TEST(PathTracer, EveryMaterialIsWhiteInAWhiteWorld) {
    for (const auto& [model, roughness] : {std::pair(Model::principled, 0.3F),
                                           {Model::principled, 1.0F},
                                           {Model::glossy, 0.0F},
                                           {Model::glossy, 0.5F},
                                           {Model::glass, 0.0F},
                                           {Model::glass, 0.2F}}) {
        const Scene scene = scene_of(test::sphere(12), {}, 1.0F, of_model(model, roughness));
        const Picture picture =
            picture_of(scene, from_above(0.6), 16, {.samples = 32, .paths = {30, 1}});
        EXPECT_NEAR(mean(picture), 1.0, 5e-3) << int(model) << " " << roughness;
    }
}

TEST(PathTracer, GlossShowsLampsAndEmittersAsBrightHoweverTheyAreFound) {
    // A lamp of each kind with extent over a glossy floor that also shows an emitter.
    for (const LightKind kind :
         {LightKind::point, LightKind::spot, LightKind::area, LightKind::sun}) {
        Light light = lamp(kind, kind == LightKind::sun ? 3.0F : 60.0F, {0.3, 0.2, 2.0});
        light.size_x = light.size_y = kind == LightKind::area ? 2.0 : 0.8;
        Array<glm::vec3> vertices{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0},    {-1, 1, 0},
                                  {-1, 0, 0},  {-1, 1, 0}, {-1, 0.5F, 1}};
        const Scene scene = make_scene(
            {test::shared(make_mesh(std::move(vertices), {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}})),
             {of_model(Model::glossy, 0.5F, 0.8F), diffuse(0.0F, 5.0F)},
             {0, 0, 1},
             {light}});
        const auto ours = [&](std::uint32_t shadow_rays) {
            return mean(picture_of(scene, from_above(0.8), 16,
                                   {.samples = 128, .paths = {1, shadow_rays}}));
        };
        const double expected = ours(4);
        EXPECT_GT(expected, 0.05);
        EXPECT_NEAR(ours(1), expected, 0.01 * expected) << int(kind);
        EXPECT_NEAR(ours(0), expected, 0.03 * expected) << int(kind);
    }
}

TEST(PathTracer, AMirrorShowsTheEmitterAsItIs) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, 1.0F);
    add_square(vertices, triangles, 6.0F, 50.0F);
    const Scene scene =
        make_scene({test::shared(make_mesh(std::move(vertices), std::move(triangles))),
                    {of_model(Model::glossy, 0.0F, 0.5F), diffuse(0.0F, 3.0F)},
                    {0, 0, 1, 1}});
    const Picture picture = picture_of(scene, from_above(0.9), 4, {.samples = 4, .paths = {0, 2}});
    EXPECT_NEAR(mean(picture), 1.5, 1e-6);
    EXPECT_EQ(picture.rays.shadow, 0U);
}

TEST(PathTracer, EverySampleIsFinite) {
    Mesh mesh = test::random_soup(500);
    Array<std::uint32_t> index(mesh.size());
    std::vector<Material> materials;
    for (const Model model : {Model::principled, Model::glossy, Model::glass, Model::refraction,
                              Model::translucent, Model::transparent})
        for (const float roughness : {0.0F, 0.02F, 0.7F})
            materials.push_back(of_model(model, roughness, 0.9F));
    materials.push_back(diffuse(0.5F, 2.0F));
    for (std::size_t i = 0; i < index.size(); ++i) index[i] = std::uint32_t(i % materials.size());
    Array<glm::vec3> normals(3 * mesh.size());
    std::mt19937 random(5);
    std::normal_distribution<float> coordinate;
    for (glm::vec3& normal : normals)
        normal = glm::normalize(glm::vec3(coordinate(random), coordinate(random), 0.1F));
    const Scene scene = make_scene({test::shared(std::move(mesh)),
                                    std::move(materials),
                                    std::move(index),
                                    {lamp(LightKind::point, 5, {0.5, 0.5, 0.5})},
                                    {glm::vec3(0.2F)},
                                    {},
                                    {},
                                    {},
                                    std::move(normals)});
    Camera camera = from_above(0.5);
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0.5, 3));
    const Picture picture = picture_of(scene, camera, 24, {.samples = 16});
    for (const glm::vec3& pixel : picture.film.pixels)
        ASSERT_TRUE(std::isfinite(pixel.x + pixel.y + pixel.z));
    EXPECT_GT(mean(picture), 0.05);
}

// --- bit by bit ----------------------------------------------------------------------------------

TEST(Renderer, SamplesAddedOneByOneGiveTheSameBits) {
    const Scene scene = nook();
    const Bvh bvh = tree_of(scene.mesh);
    const Camera camera = below_roof();
    const PictureOptions options{.samples = 21, .passes = true};
    const Picture expected = picture_of(bvh, scene, camera, 8, options);
    Renderer renderer({bvh, scene, camera, {8, 8, options.seed}}, options.render());
    Token token;
    for (const std::uint32_t samples : {1U, 1U, 19U}) renderer.render(samples, token);
    const Picture picture = renderer.picture();
    EXPECT_EQ(picture.samples, 21U);
    EXPECT_EQ(picture.film.pixels, expected.film.pixels);
    EXPECT_EQ(picture.film.normal, expected.film.normal);
    EXPECT_EQ(picture.film.depth, expected.film.depth);
    EXPECT_EQ(picture.rays, expected.rays);
}

TEST(Renderer, CancelledItKeepsWhatItHasAndGoesOn) {
    const Scene scene = nook();
    const Bvh bvh = tree_of(scene.mesh);
    const Camera camera = below_roof();
    PictureOptions options{.samples = 2, .threads = 1, .batch = 20};
    Renderer renderer({bvh, scene, camera, {8, 8, options.seed}}, options.render());
    Token token;
    renderer.render(1, token);
    token.cancel();
    EXPECT_THROW(renderer.render(1, token), Cancelled);
    EXPECT_EQ(renderer.samples(), 1U);
    EXPECT_EQ(renderer.picture().film.pixels,
              picture_of(bvh, scene, camera, 8, {.samples = 1}).film.pixels);
    Token fresh;
    renderer.render(1, fresh);
    EXPECT_EQ(renderer.picture().film.pixels,
              picture_of(bvh, scene, camera, 8, options).film.pixels);
}

TEST(Film, PixelsMayHaveDifferentNumbersOfSamples) {
    Film film(3, false);
    const Array<glm::vec3> light{glm::vec3(1.0F), glm::vec3(3.0F), glm::vec3(5.0F),
                                 glm::vec3(7.0F)};
    film.add({0, 2, 0, 2}, light, {});
    EXPECT_EQ(film.picture().pixels,
              (Array<glm::vec3>{glm::vec3(2.0F), glm::vec3(6.0F), glm::vec3(0.0F)}));
    film.add({0, 1, 2, 1}, {&light[3], 1}, {});
    EXPECT_FLOAT_EQ(film.picture().pixels[0].x, 11.0F / 3.0F);
}

TEST(Renderer, PassesTellWhatTheCameraSees) {
    const Scene scene = scene_of(plane(1.0F), {}, 1.0F);
    Camera camera = from_above(2.0);  // sees past the plane
    camera.clip_start = 1.0;
    const Picture picture = picture_of(scene, camera, 4, {.samples = 3, .passes = true});
    for (std::size_t i = 0; i < 16; ++i) {
        const bool hit = i == 5 || i == 6 || i == 9 || i == 10;
        EXPECT_EQ(picture.film.normal[i], glm::vec3(0, 0, hit ? 1 : 0));
        EXPECT_EQ(picture.film.albedo[i], glm::vec3(hit ? 0.8F : 0.0F));
        EXPECT_EQ(picture.film.depth[i], hit ? 4.0F : std::numeric_limits<float>::infinity());
        EXPECT_EQ(picture.film.triangle_tests[i], hit ? 2.0F : 0.0F);
    }
}

// --- path rays -----------------------------------------------------------------------------------

TEST(PathRays, AreThoseThatRenderingTraces) {
    const Scene scene = nook();
    const Bvh bvh = tree_of(scene.mesh);
    const Camera camera = below_roof();
    const PathSettings paths{3, 2};
    Token token;
    const View view{bvh, scene, camera, {260, 260, 3}};  // more than a batch
    const PathRays rays = path_rays(view, paths, 0, 0, token);
    const RayCounts counts = render(view, 1, {{paths, Reorder::off, false}}, token).rays;
    std::uint64_t secondary = 0, shadow = 0;
    for (const RayArrays& bounce : rays.secondary) secondary += bounce.origins.size();
    for (const ShadowRays& bounce : rays.shadow) {
        shadow += bounce.rays.origins.size();
        for (const glm::vec3& direction : bounce.rays.directions)
            ASSERT_GT(glm::length(direction), 0.0F);
    }
    EXPECT_EQ(rays.primary.origins.size(), 67600U);
    EXPECT_EQ(rays.secondary.size(), 3U);
    EXPECT_EQ(rays.shadow.size(), 4U);
    EXPECT_EQ(secondary, counts.secondary);
    EXPECT_EQ(shadow, counts.shadow);
    EXPECT_GT(secondary, 60000U);

    const PathRays again =
        path_rays({tree_of(scene.mesh, "sah", 2), scene, camera, view.raster}, paths, 0, 1, token);
    EXPECT_EQ(again.secondary[2].directions, rays.secondary[2].directions);
    EXPECT_EQ(again.shadow[3].t_max, rays.shadow[3].t_max);
}

}  // namespace
}  // namespace bvhlab
