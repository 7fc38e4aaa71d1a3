// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes: what they use, and the sentences that refuse bad ones.
#include "scene/scene.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>

#include "meshes.h"

namespace bvhlab {
namespace {

constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

SceneParts parts_of(std::vector<Material> materials) {
    Array<std::uint32_t> index(3, std::uint32_t(materials.size() - 1));
    return {test::shared(test::copies(3)), std::move(materials), std::move(index)};
}

Material only(const Component& component) {
    return {{component}, {}};
}

/// Parts that use everything there is.
SceneParts good_parts() {
    Component component;
    component.color.lookup = 0;
    component.roughness.lookup = 1;
    SceneParts parts = parts_of({only(component)});
    parts.lights = {Light{}};
    parts.world.color = glm::vec3(1.0F);
    parts.world.texture = 0;
    auto texture = std::make_shared<Texture>();
    texture->channels = 1;
    texture->floats = {0.5F};
    parts.textures = {texture};
    parts.lookups = {{}, {0, Channel::red}};
    parts.uvs = Array<glm::vec2>(9, glm::vec2(0.5F));
    parts.normals = Array<glm::vec3>(9, glm::vec3(0.0F, 0.0F, 1.0F));
    return parts;
}

std::string complaint(const std::function<void(SceneParts&)>& change) {
    SceneParts parts = good_parts();
    change(parts);
    try {
        make_scene(std::move(parts));
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

#define EXPECT_COMPLAINT(words, change)                                                \
    EXPECT_NE(complaint([](SceneParts& p) { change; }).find(words), std::string::npos) \
        << complaint([](SceneParts& p) { change; })

TEST(Scene, BadMaterialsAreNamed) {
    EXPECT_EQ(complaint([](SceneParts&) {}), "");
    EXPECT_EQ(complaint([](SceneParts& p) { p.materials.clear(); }),
              "the scene needs at least one material");
    EXPECT_EQ(complaint([](SceneParts& p) { p.material_index[2] = 1; }),
              "triangle 2 has material 1, but there are only 1 materials");
    EXPECT_EQ(complaint([](SceneParts& p) { p.material_index.pop_back(); }),
              "material_index has 2 entries for 3 triangles");
    EXPECT_EQ(complaint([](SceneParts& p) { p.materials[0].components[0].color.value.r = 2.0F; }),
              "material 0, component 0: color is (2, 0.8, 0.8): each channel must be 0 to 1");
    EXPECT_EQ(complaint([](SceneParts& p) { p.materials[0].components[0].ior = 0.5F; }),
              "material 0, component 0: ior is 0.5: it must be 1 to 10");
    EXPECT_COMPLAINT("weight is nan", p.materials[0].components[0].weight.value = not_a_number);
    EXPECT_COMPLAINT("has 5 components; at most 4", p.materials[0].components.resize(5));
    EXPECT_COMPLAINT("material 0: emission is (-1,", p.materials[0].emission.value.r = -1.0F);
    EXPECT_COMPLAINT("metallic is lookup 7, but there are only 2",
                     p.materials[0].components[0].metallic.lookup = 7);
    EXPECT_COMPLAINT("choose one channel", p.materials[0].components[0].metallic.lookup = 0);
    EXPECT_COMPLAINT("color looks up texture 0, but the scene has no uvs", p.uvs.clear());
}

TEST(Scene, BadTexturesAreNamed) {
    EXPECT_EQ(complaint([](SceneParts& p) { p.textures[0] = nullptr; }), "texture 0 is missing");
    EXPECT_COMPLAINT("texture 0: a texture has 1, 3 or 4 channels", {
        auto texture = std::make_shared<Texture>();
        texture->channels = 2;
        p.textures[0] = texture;
    });
    EXPECT_COMPLAINT("lookup 1 refers to texture 3", p.lookups[1].texture = 3);
    EXPECT_COMPLAINT("lookup 0: scale (nan", p.lookups[0].scale.r = not_a_number);
    EXPECT_COMPLAINT("lookup 0: the mapping", p.lookups[0].mapping[2].y = not_a_number);
}

TEST(Scene, BadCornersAreNamed) {
    EXPECT_EQ(complaint([](SceneParts& p) { p.uvs.pop_back(); }),
              "uvs has 8 corners for 3 triangles; there must be three for each");
    EXPECT_COMPLAINT("triangle 1, corner 2 has uv", p.uvs[5].x = not_a_number);
    EXPECT_EQ(complaint([](SceneParts& p) { p.normals[4] = glm::vec3(0.0F); }),
              "triangle 1, corner 1 has normal (0, 0, 0): it must have unit length");
    EXPECT_COMPLAINT("triangle 0, corner 0 has normal", p.normals[0].y = not_a_number);
}

TEST(Scene, BadLightsAreNamed) {
    EXPECT_COMPLAINT("light 0: the light's color", p.lights[0].color.y = -1.0F);
    EXPECT_COMPLAINT("the world's color", p.world.color.y = not_a_number);
    EXPECT_COMPLAINT("the world refers to texture 4", p.world.texture = 4);
    EXPECT_COMPLAINT("must be a rotation", p.world.to_texture[0].x = 2.0);
    EXPECT_COMPLAINT("no mesh", p.mesh = nullptr);
}

// --- features ------------------------------------------------------------------------------------

TEST(Scene, UsesOnlyWhatItHolds) {
    const Features all = make_scene(good_parts()).features;
    EXPECT_TRUE(all.textures && all.smooth && all.lamps && all.world && all.environment);
    EXPECT_FALSE(all.gloss || all.transmission || all.transparency || all.emitters);
    const Scene plain = make_scene(parts_of({Material{}}));
    const Features& none = plain.features;
    EXPECT_FALSE(none.textures || none.smooth || none.gloss || none.transmission ||
                 none.transparency || none.emitters || none.lamps || none.world ||
                 none.environment);
}

TEST(Scene, FeaturesFollowTheModels) {
    const auto features_of = [](Model model, float weight = 1.0F) {
        Component component;
        component.model = model;
        component.weight.value = weight;
        return make_scene(parts_of({only(component)})).features;
    };
    EXPECT_TRUE(features_of(Model::principled).gloss);
    EXPECT_FALSE(features_of(Model::principled).transmission);
    EXPECT_FALSE(features_of(Model::principled, 0.0F).gloss);
    EXPECT_TRUE(features_of(Model::glass).transmission && features_of(Model::glass).gloss);
    EXPECT_TRUE(features_of(Model::translucent).transmission);
    EXPECT_FALSE(features_of(Model::glossy).transmission);
    EXPECT_TRUE(features_of(Model::transparent).transparency);
    EXPECT_FALSE(features_of(Model::transparent).gloss);
}

TEST(Scene, MaterialsThatNoTriangleHasDoNotCount) {
    Component glass;
    glass.model = Model::glass;
    Material lamp;
    lamp.emission.value = glm::vec3(1.0F);
    SceneParts parts = parts_of({only(glass), lamp, Material{}});
    EXPECT_FALSE(make_scene(parts).features.gloss);
    EXPECT_FALSE(make_scene(parts).features.emitters);
    parts.material_index[1] = 1;
    EXPECT_TRUE(make_scene(parts).features.emitters);
}

TEST(Scene, CoordinatesThatNothingUsesAreDropped) {
    SceneParts parts = parts_of({Material{}});
    parts.uvs = Array<glm::vec2>(9, glm::vec2(0.5F));
    EXPECT_TRUE(make_scene(parts).uvs.empty());
    EXPECT_EQ(make_scene(good_parts()).uvs.size(), 9U);
}

}  // namespace
}  // namespace bvhlab
