// SPDX-License-Identifier: GPL-3.0-or-later
// Textures: interpolation, wrapping, decoding, refused ones.
#include "scene/texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace bvhlab {
namespace {

/// Two texels side by side, 0 and 1.
Texture step(Wrap wrap, bool closest = false) {
    Texture texture;
    texture.width = 2;
    texture.channels = 1;
    texture.floats = {0.0F, 1.0F};
    texture.wrap = wrap;
    texture.closest = closest;
    return texture;
}

float red(const Texture& texture, float u, float v = 0.5F) {
    return look_up(texture, {u, v}).r;
}

TEST(Texture, IsBilinearBetweenTexelCentres) {
    const Texture texture = step(Wrap::extend);
    EXPECT_EQ(red(texture, 0.25F), 0.0F);
    EXPECT_EQ(red(texture, 0.75F), 1.0F);
    EXPECT_NEAR(red(texture, 0.5F), 0.5F, 1e-6F);
    EXPECT_NEAR(red(texture, 0.4F), 0.3F, 1e-6F);
    EXPECT_EQ(red(step(Wrap::extend, true), 0.49F), 0.0F);
    EXPECT_EQ(red(step(Wrap::extend, true), 0.51F), 1.0F);
}

TEST(Texture, RowsRunFromTheTop) {
    Texture texture = step(Wrap::extend, true);
    texture.width = 1;
    texture.height = 2;
    EXPECT_EQ(red(texture, 0.5F, 0.9F), 0.0F);
    EXPECT_EQ(red(texture, 0.5F, 0.1F), 1.0F);
}

TEST(Texture, WrapsAsNamed) {
    EXPECT_NEAR(red(step(Wrap::repeat), 0.0F), 0.5F, 1e-6F);
    EXPECT_NEAR(red(step(Wrap::repeat), 1.75F), 1.0F, 1e-6F);
    EXPECT_NEAR(red(step(Wrap::repeat), -0.25F), 1.0F, 1e-6F);
    EXPECT_EQ(red(step(Wrap::extend), -5.0F), 0.0F);
    EXPECT_EQ(red(step(Wrap::extend), 5.0F), 1.0F);
    EXPECT_NEAR(red(step(Wrap::mirror), 1.25F), 1.0F, 1e-6F);
    EXPECT_NEAR(red(step(Wrap::mirror), 1.75F), 0.0F, 1e-6F);
    EXPECT_NEAR(red(step(Wrap::mirror), -0.75F), 1.0F, 1e-6F);
    EXPECT_EQ(look_up(step(Wrap::clip), {1.3F, 0.5F}), glm::vec4(0.0F));
    EXPECT_EQ(look_up(step(Wrap::clip, true), {-0.1F, 0.5F}), glm::vec4(0.0F));
    EXPECT_EQ(red(step(Wrap::clip, true), 0.9F), 1.0F);
    EXPECT_NEAR(look_up(step(Wrap::clip), {1.0F, 0.5F}).a, 0.5F, 1e-6F);
}

TEST(Texture, AnyCoordinateIsAnswered) {
    for (const Wrap wrap : {Wrap::repeat, Wrap::extend, Wrap::clip, Wrap::mirror})
        for (const bool closest : {false, true})
            for (const float u : {-1e30F, 1e30F, std::numeric_limits<float>::infinity(),
                                  std::numeric_limits<float>::quiet_NaN(), -1e-9F, 1.0F, 0.0F})
                for (const float v : {u, 0.5F}) {
                    const float value = red(step(wrap, closest), u, v);
                    EXPECT_TRUE(value >= 0.0F && value <= 1.0F) << u;
                }
}

TEST(Texture, BytesAreDecoded) {
    Texture texture;
    texture.channels = 4;
    texture.bytes = {188, 10, 255, 128};
    texture.srgb = true;
    const glm::vec4 value = look_up(texture, {0.5F, 0.5F});
    EXPECT_NEAR(value.r, std::pow((188.0 / 255.0 + 0.055) / 1.055, 2.4), 1e-5);
    EXPECT_NEAR(value.g, 10.0 / 255.0 / 12.92, 1e-5);
    EXPECT_NEAR(value.b, 1.0, 1e-5);
    EXPECT_NEAR(value.a, 128.0 / 255.0, 1e-6);
    texture.srgb = false;
    EXPECT_NEAR(look_up(texture, {0.5F, 0.5F}).r, 188.0 / 255.0, 1e-5);
}

TEST(Texture, DecodingOfFloatsAndBytesAgrees) {
    Texture bytes = step(Wrap::extend), floats = bytes;
    bytes.floats = {};
    bytes.bytes = {51, 204};
    floats.floats = {51.0F / 255.0F, 204.0F / 255.0F};
    bytes.srgb = floats.srgb = true;
    EXPECT_NEAR(red(bytes, 0.25F), red(floats, 0.25F), 1e-6F);
    EXPECT_NEAR(average(bytes).r, average(floats).r, 1e-6F);
    EXPECT_NEAR(average(bytes).r, 0.5F * (red(bytes, 0.25F) + red(bytes, 0.75F)), 1e-6F);
    EXPECT_EQ(average(bytes).a, 1.0F);
}

TEST(Texture, TexelsThatAreNotFiniteCountAsZero) {
    Texture texture = step(Wrap::extend);
    texture.floats = {std::numeric_limits<float>::quiet_NaN(), 1.0F};
    EXPECT_EQ(red(texture, 0.0F), 0.0F);
    EXPECT_EQ(average(texture).r, 0.5F);
}

TEST(Texture, BadOnesAreNamed) {
    const auto complaint = [](const auto& change) {
        Texture texture = step(Wrap::repeat);
        change(texture);
        try {
            check_texture(texture);
        } catch (const std::invalid_argument& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(complaint([](Texture&) {}), "");
    EXPECT_EQ(complaint([](Texture& t) { t.width = 0; }), "the texture is empty: 0 x 1 texels");
    EXPECT_EQ(complaint([](Texture& t) { t.channels = 2; }),
              "a texture has 1, 3 or 4 channels, not 2");
    EXPECT_NE(complaint([](Texture& t) { t.height = 70000; }).find("at most 65535"),
              std::string::npos);
    EXPECT_NE(complaint([](Texture& t) { t.width = 3; }).find("instead of 3"), std::string::npos);
    EXPECT_NE(complaint([](Texture& t) { t.bytes = {1}; }).find("1 bytes and 2 floats"),
              std::string::npos);
}

}  // namespace
}  // namespace bvhlab
