// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include "base/array.h"

namespace bvhlab {

/// What a texture is outside of [0, 1]: the names and meaning of Blender's Image Texture node.
enum class Wrap { repeat, extend, clip, mirror };

/// So that texel coordinates stay exact in float.
inline constexpr std::uint32_t most_texels_a_side = 65535;

/// A picture that materials and the world look up. Rows run from the top; v = 0 is the lower edge.
/// Either `bytes` or `floats` holds width * height * channels values.
struct Texture {
    std::uint32_t width = 1, height = 1;
    std::uint32_t channels = 4;  ///< 1 (grey), 3 (RGB) or 4 (RGBA, colour not multiplied by alpha)
    Array<std::uint8_t> bytes;   ///< 0 to 255
    Array<float> floats;
    bool srgb = false;     ///< colours are encoded with the sRGB curve; alpha never is
    bool closest = false;  ///< no interpolation between texels
    Wrap wrap = Wrap::repeat;
};

/// Throws std::invalid_argument saying what is wrong: sides, channels or the number of values.
void check_texture(const Texture& texture);

/// Linear RGBA at `uv`: bilinear between texel centres, as Cycles does it: bytes are interpolated
/// as they are stored, and then decoded; colours are weighted by alpha. Alpha is 1 where the
/// texture has none, and grey fills RGB. Not finite texels count as 0. `clip` fades to (0, 0, 0, 0)
/// over half a texel around the picture.
glm::vec4 look_up(const Texture& texture, const glm::vec2& uv);

/// Mean of all texels, linear RGBA: what stands for a texture in the power of a light.
glm::vec4 average(const Texture& texture);

}  // namespace bvhlab
