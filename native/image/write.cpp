// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/write.h"

#include <OpenImageIO/color.h>
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

namespace bvhlab {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, const std::string& reason) {
    throw std::runtime_error("cannot write " + path.string() + ": " + reason);
}

std::string lower_extension(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return extension;
}

/// A name beside `path` that nobody else uses.
fs::path name_aside(const fs::path& path) {
    static std::atomic<unsigned> counter = 0;
    const std::string mark = std::to_string(getpid()) + "-" + std::to_string(++counter);
    return path.parent_path() /
           (path.stem().string() + ".part-" + mark + path.extension().string());
}

/// A value in [0, 1] as sRGB; NaN becomes 0.
float to_srgb(float value) {
    return value > 0.0F ? std::min(OIIO::linear_to_sRGB(std::min(value, 1.0F)), 1.0F) : 0.0F;
}

/// Display values of a picture. Colours are divided by alpha while still linear: PNG wants them so.
std::vector<float> display_values(const ImageView& image) {
    std::vector<float> values(image.values, image.values + image.value_count());
    const std::size_t channels = std::size_t(image.channels);
    const std::size_t colours = std::min<std::size_t>(channels, 3);
    for (std::size_t first = 0; first < values.size(); first += channels) {
        const float alpha = channels == 4 ? values[first + 3] : 1.0F;
        for (std::size_t i = first; i < first + colours; ++i)
            values[i] = to_srgb(alpha > 0.0F ? values[i] / alpha : values[i]);
        if (channels == 4) values[first + 3] = alpha > 0.0F ? std::min(alpha, 1.0F) : 0.0F;
    }
    return values;
}

/// The bytes of the picture's file. In memory, because OpenImageIO does not notice a full disk
/// under a PNG.
std::vector<unsigned char> encode(const fs::path& path, const OIIO::ImageSpec& spec,
                                  const float* values) {
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path.string());
    if (!output) refuse(path, OIIO::geterror());
    const bool written = output->set_ioproxy(&memory) && output->open(path.string(), spec) &&
                         output->write_image(OIIO::TypeDesc::FLOAT, values) && output->close();
    if (!written) refuse(path, output->geterror());
    return bytes;
}

/// Writes the bytes to `file`; false with errno set where not all of them could be written.
bool write_bytes(const fs::path& file, const std::vector<unsigned char>& bytes) {
    std::FILE* stream = std::fopen(file.c_str(), "wb");
    if (!stream) return false;
    const bool written = std::fwrite(bytes.data(), 1, bytes.size(), stream) == bytes.size() &&
                         std::fflush(stream) == 0;
    const int reason = errno;
    const bool closed = std::fclose(stream) == 0;
    if (!written) errno = reason;
    return written && closed;
}

/// Puts the bytes at `path` all at once, or throws and leaves what was there.
void replace_file(const fs::path& path, const std::vector<unsigned char>& bytes) {
    const fs::path aside = name_aside(path);
    std::error_code error;
    if (write_bytes(aside, bytes))
        fs::rename(aside, path, error);
    else
        error = std::error_code(errno, std::generic_category());
    if (!error) return;
    std::error_code ignored;
    fs::remove(aside, ignored);
    refuse(path, error.message());
}

void check(const fs::path& path, const ImageView& image, const std::string& extension) {
    if (extension != ".exr" && extension != ".png")
        throw std::invalid_argument("cannot write " + path.string() +
                                    ": the extension must be .exr or .png");
    if (image.width < 1 || image.height < 1)
        throw std::invalid_argument("cannot write " + path.string() + ": the picture is empty");
    if (image.channels != 1 && image.channels != 3 && image.channels != 4)
        throw std::invalid_argument("cannot write " + path.string() + ": a picture has 1, 3 or 4 " +
                                    "channels, not " + std::to_string(image.channels));
    const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
    std::error_code error;
    if (!fs::is_directory(folder, error)) refuse(path, "there is no folder " + folder.string());
    if (fs::is_directory(path, error)) refuse(path, "it is a folder");
}

}  // namespace

void write_image(const fs::path& path, const ImageView& image) {
    const std::string extension = lower_extension(path);
    check(path, image, extension);
    const bool is_png = extension == ".png";
    OIIO::ImageSpec spec(image.width, image.height, image.channels,
                         is_png ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT);
    if (image.channels == 1) spec.channelnames = {"Y"};
    if (is_png) {
        spec.attribute("oiio:ColorSpace", "sRGB");
        spec.attribute("oiio:UnassociatedAlpha", 1);
    } else {
        spec.attribute("compression", "zip");
    }

    const std::vector<float> display = is_png ? display_values(image) : std::vector<float>();
    replace_file(path, encode(path, spec, is_png ? display.data() : image.values));
}

}  // namespace bvhlab
