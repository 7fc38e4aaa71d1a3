// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/read.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

namespace bvhlab {
namespace {

namespace fs = std::filesystem;

/// Libraries quote what they do not understand: bytes of the file, which are no text.
[[noreturn]] void refuse(const fs::path& path, std::string reason) {
    const auto is_text = [](char c) { return (c >= ' ' && c <= '~') || c == '\n'; };
    std::ranges::replace_if(reason, std::not_fn(is_text), '?');
    throw std::runtime_error("cannot read " + path.string() + ": " + reason);
}

std::unique_ptr<OIIO::ImageInput> open(const fs::path& path) {
    std::error_code error;
    if (!fs::exists(path, error)) refuse(path, "there is no such file");
    if (fs::is_directory(path, error)) refuse(path, "it is a folder");
    OIIO::ImageSpec wishes;
    wishes.attribute("oiio:UnassociatedAlpha", 1);  // leave what is stored so as it is
    std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path.string(), &wishes);
    if (!input) refuse(path, OIIO::geterror());
    const OIIO::ImageSpec& spec = input->spec();
    constexpr int most = int(most_texels_a_side);
    if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1) refuse(path, "it is empty");
    if (spec.width > most || spec.height > most)
        refuse(path, "it has " + std::to_string(spec.width) + " x " + std::to_string(spec.height) +
                         " pixels; a side has at most " + std::to_string(most));
    return input;
}

/// Which channels of the file a texture takes: 1, 3 or 4 of them.
std::vector<int> kept_channels(const OIIO::ImageSpec& spec) {
    const int alpha = spec.alpha_channel;
    const bool has_alpha = alpha >= 0 && alpha < spec.nchannels;
    std::vector<int> colors;
    for (int channel = 0; channel < spec.nchannels; ++channel)
        if (!(has_alpha && channel == alpha)) colors.push_back(channel);
    if (colors.empty()) return {alpha};
    const int grey = colors[0];
    if (colors.size() < 3)
        return has_alpha ? std::vector<int>{grey, grey, grey, alpha} : std::vector<int>{grey};
    std::vector<int> kept{colors[0], colors[1], colors[2]};
    if (has_alpha) kept.push_back(alpha);
    return kept;
}

template <class Value>
Array<Value> read_values(const fs::path& path, OIIO::ImageInput& input, OIIO::TypeDesc type,
                         const std::vector<int>& kept) {
    const OIIO::ImageSpec spec = input.spec();
    const std::size_t channels = std::size_t(spec.nchannels);
    const std::size_t pixels = std::size_t(spec.width) * std::size_t(spec.height);
    Array<Value> all(pixels * channels);
    if (!input.read_image(0, 0, 0, spec.nchannels, type, all.data()))
        refuse(path, input.geterror());
    Array<Value> values(pixels * kept.size());
    for (std::size_t pixel = 0; pixel < pixels; ++pixel)
        for (std::size_t i = 0; i < kept.size(); ++i)
            values[pixel * kept.size() + i] = all[pixel * channels + std::size_t(kept[i])];
    return values;
}

/// Divides colours by alpha, but where that is 0: there the colour is light without coverage.
void unassociate(Array<float>& values) {
    for (std::size_t first = 0; first + 3 < values.size(); first += 4) {
        const float alpha = values[first + 3];
        if (!(alpha > 0.0F)) continue;
        for (std::size_t i = first; i < first + 3; ++i) values[i] /= alpha;
    }
}

void unassociate(Array<std::uint8_t>& values) {
    for (std::size_t first = 0; first + 3 < values.size(); first += 4) {
        const int alpha = values[first + 3];
        if (alpha == 0) continue;
        for (std::size_t i = first; i < first + 3; ++i)
            values[i] = std::uint8_t(std::min((int(values[i]) * 255 + alpha / 2) / alpha, 255));
    }
}

Texture read_checked(const fs::path& path) {
    const std::unique_ptr<OIIO::ImageInput> input = open(path);
    const OIIO::ImageSpec& spec = input->spec();
    const std::vector<int> kept = kept_channels(spec);
    const bool associated =
        kept.size() == 4 && spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0;

    Texture texture;
    texture.width = std::uint32_t(spec.width);
    texture.height = std::uint32_t(spec.height);
    texture.channels = std::uint32_t(kept.size());
    if (spec.format == OIIO::TypeDesc::UINT8) {
        texture.bytes = read_values<std::uint8_t>(path, *input, OIIO::TypeDesc::UINT8, kept);
        if (associated) unassociate(texture.bytes);
    } else {
        texture.floats = read_values<float>(path, *input, OIIO::TypeDesc::FLOAT, kept);
        if (associated) unassociate(texture.floats);
    }
    return texture;
}

}  // namespace

Texture read_texture(const fs::path& path) {
    try {
        return read_checked(path);
    } catch (const std::bad_alloc&) {
        refuse(path, "its pixels do not fit in memory");
    }
}

}  // namespace bvhlab
