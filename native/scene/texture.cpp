// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <stdexcept>
#include <string>

namespace bvhlab {
namespace {

/// The sRGB transfer curve (IEC 61966-2-1), from encoded to linear.
double decode(double encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

/// Linear values of the encoded bytes; one more, so that the last has an upper neighbour.
const std::array<float, 257>& decoded_bytes() {
    static const std::array<float, 257> table = [] {
        std::array<float, 257> values{};
        for (std::size_t i = 0; i < 256; ++i) values[i] = float(decode(double(i) / 255.0));
        values[256] = values[255];
        return values;
    }();
    return table;
}

/// Linear value of an encoded one between two bytes, 0 to 255. Straight between them: off by less
/// than 7e-6.
float decode_byte(float encoded) {
    const int below = std::clamp(int(encoded), 0, 255);
    const auto& table = decoded_bytes();
    const float low = table[std::size_t(below)];
    return low + (encoded - float(below)) * (table[std::size_t(below) + 1] - low);
}

/// Values of one texel, RGBA, before `linear`: bytes as they are, floats already linear.
glm::vec4 texel(const Texture& texture, std::size_t x, std::size_t y) {
    const bool has_bytes = !texture.bytes.empty();
    const std::size_t first = (y * texture.width + x) * texture.channels;
    glm::vec4 value(has_bytes ? 255.0F : 1.0F);
    for (std::uint32_t channel = 0; channel < texture.channels; ++channel) {
        float& read = value[int(channel)];
        if (has_bytes) {
            read = float(texture.bytes[first + channel]);
            continue;
        }
        read = texture.floats[first + channel];
        if (!std::isfinite(read)) read = 0.0F;
        if (texture.srgb && channel < 3) read = float(decode(double(read)));
    }
    if (texture.channels == 1) value.g = value.b = value.r;
    return value;
}

glm::vec4 linear(const Texture& texture, const glm::vec4& value) {
    if (texture.bytes.empty()) return value;
    if (!texture.srgb) return value * (1.0F / 255.0F);
    return {decode_byte(value.r), decode_byte(value.g), decode_byte(value.b),
            value.a * (1.0F / 255.0F)};
}

/// A coordinate brought to [0, 1], or for `clip` to [-1, 2] (where all beyond [0, 1] is empty).
float wrapped(float coordinate, Wrap wrap) {
    constexpr float limit = 1e9F;  // beyond, no digit says where in the texture it is
    const float bounded = coordinate > -limit ? std::min(coordinate, limit) : -limit;  // NaN too
    switch (wrap) {
        case Wrap::repeat:
            return bounded - std::floor(bounded);
        case Wrap::extend:
            return std::clamp(bounded, 0.0F, 1.0F);
        case Wrap::clip:
            return std::clamp(bounded, -1.0F, 2.0F);
        case Wrap::mirror: {
            const float in_period = bounded - 2.0F * std::floor(0.5F * bounded);
            return in_period > 1.0F ? 2.0F - in_period : in_period;
        }
    }
    return 0.0F;
}

/// The texel in this row or column, which may lie just outside; -1: none.
std::int64_t index_of(float place, std::uint32_t size, Wrap wrap) {
    const auto index = std::int64_t(place), last = std::int64_t(size) - 1;
    if (index >= 0 && index <= last) return index;
    if (wrap == Wrap::clip) return -1;
    if (wrap == Wrap::repeat) return index < 0 ? last : 0;
    return index < 0 ? 0 : last;
}

float opaque(const Texture& texture) {
    return texture.bytes.empty() ? 1.0F : 255.0F;
}

/// The texel with its colour times alpha: what is transparent has no say in what lies beside it.
glm::vec4 texel_or_empty(const Texture& texture, std::int64_t x, std::int64_t y) {
    if (x < 0 || y < 0) return glm::vec4(0.0F);
    const glm::vec4 value = texel(texture, std::size_t(x), std::size_t(y));
    if (value.a == opaque(texture)) return value;
    return {glm::vec3(value) * (value.a / opaque(texture)), value.a};
}

/// The colour without alpha again; black where nothing is to be seen.
glm::vec4 without_alpha(const Texture& texture, const glm::vec4& value) {
    if (texture.channels < 4 || value.a == opaque(texture) || !(value.a > 0.0F)) return value;
    return {glm::vec3(value) * (opaque(texture) / value.a), value.a};
}

}  // namespace

void check_texture(const Texture& texture) {
    const std::string size = std::to_string(texture.width) + " x " + std::to_string(texture.height);
    if (texture.width < 1 || texture.height < 1)
        throw std::invalid_argument("the texture is empty: " + size + " texels");
    if (texture.width > most_texels_a_side || texture.height > most_texels_a_side)
        throw std::invalid_argument("the texture has " + size + " texels; a side has at most " +
                                    std::to_string(most_texels_a_side));
    if (texture.channels != 1 && texture.channels != 3 && texture.channels != 4)
        throw std::invalid_argument("a texture has 1, 3 or 4 channels, not " +
                                    std::to_string(texture.channels));
    const std::size_t expected = std::size_t(texture.width) * texture.height * texture.channels;
    const std::size_t given = texture.bytes.size() + texture.floats.size();
    if (given != expected || (!texture.bytes.empty() && !texture.floats.empty()))
        throw std::invalid_argument("the texture of " + size + " texels has " +
                                    std::to_string(texture.bytes.size()) + " bytes and " +
                                    std::to_string(texture.floats.size()) + " floats instead of " +
                                    std::to_string(expected) + " of one of them");
}

glm::vec4 look_up(const Texture& texture, const glm::vec2& uv) {
    const Wrap wrap = texture.wrap;
    const float x = wrapped(uv.x, wrap) * float(texture.width);
    const float y = (1.0F - wrapped(uv.y, wrap)) * float(texture.height);
    if (texture.closest)
        return linear(
            texture,
            without_alpha(texture,
                          texel_or_empty(texture, index_of(std::floor(x), texture.width, wrap),
                                         index_of(std::floor(y), texture.height, wrap))));

    const float left = std::floor(x - 0.5F), upper = std::floor(y - 0.5F);
    const float across = x - 0.5F - left, down = y - 0.5F - upper;
    const std::int64_t x0 = index_of(left, texture.width, wrap);
    const std::int64_t x1 = index_of(left + 1.0F, texture.width, wrap);
    const std::int64_t y0 = index_of(upper, texture.height, wrap);
    const std::int64_t y1 = index_of(upper + 1.0F, texture.height, wrap);
    const glm::vec4 above =
        glm::mix(texel_or_empty(texture, x0, y0), texel_or_empty(texture, x1, y0), across);
    const glm::vec4 below =
        glm::mix(texel_or_empty(texture, x0, y1), texel_or_empty(texture, x1, y1), across);
    return linear(texture, without_alpha(texture, glm::mix(above, below, down)));
}

glm::vec4 average(const Texture& texture) {
    glm::dvec4 sum(0.0);
    for (std::size_t y = 0; y < texture.height; ++y)
        for (std::size_t x = 0; x < texture.width; ++x)
            sum += glm::dvec4(linear(texture, texel(texture, x, y)));
    return glm::vec4(sum / (double(texture.width) * double(texture.height)));
}

}  // namespace bvhlab
