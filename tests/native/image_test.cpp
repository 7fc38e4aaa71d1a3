// SPDX-License-Identifier: GPL-3.0-or-later
#ifdef BVHLAB_WITH_OIIO

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

#include "image/compare.h"
#include "image/error.h"
#include "image/flip.h"
#include "image/write.h"

namespace bvhlab {
namespace {

namespace fs = std::filesystem;

/// A picture as OpenImageIO reads it back.
struct ReadBack {
    OIIO::ImageSpec spec;
    std::vector<float> values;
};

ReadBack read(const fs::path& path) {
    const auto input = OIIO::ImageInput::open(path.string());
    if (!input) throw std::runtime_error(OIIO::geterror());
    ReadBack result{input->spec(), std::vector<float>(input->spec().image_pixels() *
                                                      std::size_t(input->spec().nchannels))};
    input->read_image(0, 0, 0, result.spec.nchannels, OIIO::TypeDesc::FLOAT, result.values.data());
    return result;
}

std::string refusal(const fs::path& path, const ImageView& image) {
    try {
        write_image(path, image);
    } catch (const std::exception& error) {
        return error.what();
    }
    return "";
}

/// An empty folder of this test alone.
class Image : public testing::Test {
protected:
    void SetUp() override {
        const auto* test = testing::UnitTest::GetInstance()->current_test_info();
        folder_ = fs::path(testing::TempDir()) / (std::string("bvhlab_image_") + test->name());
        fs::remove_all(folder_);
        fs::create_directory(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::size_t file_count() const {
        return std::size_t(std::distance(fs::directory_iterator(folder_), {}));
    }

    fs::path folder_;
    const std::vector<float> values_ = {0.0F, 0.25F, 1.0F,      2.5F,  -1.0F, 0.0031308F,
                                        0.5F, 0.18F, 100000.0F, 1e-3F, 0.75F, 1.0F};
    const ImageView view_{values_.data(), 2, 2, 3};
};

TEST_F(Image, ExrKeepsEveryBit) {
    write_image(folder_ / "picture.exr", view_);
    const ReadBack picture = read(folder_ / "picture.exr");
    EXPECT_EQ(picture.spec.width, 2);
    EXPECT_EQ(picture.spec.nchannels, 3);
    EXPECT_EQ(picture.spec.format, OIIO::TypeDesc::FLOAT);
    EXPECT_EQ(picture.spec.get_string_attribute("compression"), "zip");
    EXPECT_EQ(picture.values, values_);
    EXPECT_EQ(file_count(), 1U);
}

TEST_F(Image, PngIsClippedSrgb) {
    write_image(folder_ / "picture.PNG", view_);
    const ReadBack picture = read(folder_ / "picture.PNG");
    EXPECT_EQ(picture.spec.format, OIIO::TypeDesc::UINT8);
    // Levels of IEC 61966-2-1 for the values above.
    const std::vector<int> expected = {0, 137, 255, 255, 0, 10, 188, 118, 255, 3, 225, 255};
    for (std::size_t i = 0; i < expected.size(); ++i)
        EXPECT_EQ(std::lround(picture.values[i] * 255.0F), expected[i]) << i;
}

TEST_F(Image, GreyAndAlpha) {
    write_image(folder_ / "grey.png", {values_.data(), 4, 3, 1});
    EXPECT_EQ(read(folder_ / "grey.png").spec.nchannels, 1);
    write_image(folder_ / "grey.exr", {values_.data(), 4, 3, 1});
    EXPECT_EQ(read(folder_ / "grey.exr").values, values_);
    const std::vector<float> half_covered = {0.25F, 0.5F, 0.0F, 0.5F};
    write_image(folder_ / "alpha.exr", {half_covered.data(), 1, 1, 4});
    EXPECT_EQ(read(folder_ / "alpha.exr").values, half_covered);
    write_image(folder_ / "alpha.png", {half_covered.data(), 1, 1, 4});
    // The colour is 0.5, 1, 0 where covered; reading multiplies the levels by alpha again.
    OIIO::ImageSpec raw;
    raw.attribute("oiio:UnassociatedAlpha", 1);
    const auto input = OIIO::ImageInput::open((folder_ / "alpha.png").string(), &raw);
    std::vector<unsigned char> levels(4);
    input->read_image(0, 0, 0, 4, OIIO::TypeDesc::UINT8, levels.data());
    EXPECT_EQ(levels, (std::vector<unsigned char>{188, 255, 0, 128}));
}

TEST_F(Image, NotANumberIsBlackInPng) {
    const std::vector<float> values = {std::nanf(""), std::numeric_limits<float>::infinity(), 0.5F};
    write_image(folder_ / "picture.png", {values.data(), 1, 1, 3});
    EXPECT_EQ(read(folder_ / "picture.png").values[0], 0.0F);
    EXPECT_EQ(read(folder_ / "picture.png").values[1], 1.0F);
}

TEST_F(Image, ReplacesAnOldFile) {
    std::ofstream(folder_ / "picture.exr") << "not a picture";
    write_image(folder_ / "picture.exr", view_);
    EXPECT_EQ(read(folder_ / "picture.exr").values, values_);
    EXPECT_EQ(file_count(), 1U);
}

TEST_F(Image, RefusalsNameTheFileAndLeaveNothing) {
    const std::string jpeg = (folder_ / "picture.jpg").string();
    EXPECT_EQ(refusal(jpeg, view_),
              "cannot write " + jpeg + ": the extension must be .exr or .png");
    EXPECT_NE(refusal(folder_ / "picture", view_), "");
    const fs::path absent = folder_ / "absent";
    EXPECT_EQ(refusal(absent / "picture.exr", view_),
              "cannot write " + (absent / "picture.exr").string() + ": there is no folder " +
                  absent.string());
    EXPECT_NE(refusal(folder_ / "picture.exr", {values_.data(), 2, 2, 2}), "");
    EXPECT_NE(refusal(folder_ / "picture.exr", {values_.data(), 0, 2, 3}), "");
    EXPECT_EQ(file_count(), 0U);
    fs::create_directory(folder_ / "folder.png");
    EXPECT_NE(refusal(folder_ / "folder.png", view_), "");
    EXPECT_EQ(file_count(), 1U);
}

TEST_F(Image, FolderThatTakesNoFiles) {
    // Even root cannot make files in /proc.
    if (!fs::is_directory("/proc/self")) GTEST_SKIP() << "no /proc here";
    const std::string text = refusal("/proc/self/picture.exr", view_);
    EXPECT_EQ(text.find("cannot write /proc/self/picture.exr: "), 0U) << text;
    const std::string png = refusal("/proc/self/picture.png", view_);
    EXPECT_EQ(png.find("cannot write /proc/self/picture.png: "), 0U) << png;
}

/// Lets no file grow beyond `bytes` while it lives, as if the disk were full.
class FileSizeLimit {
public:
    explicit FileSizeLimit(rlim_t bytes) {
        getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit limit{bytes, before_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
        handler_ = std::signal(SIGXFSZ, SIG_IGN);
    }
    ~FileSizeLimit() {
        setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }

private:
    rlimit before_;
    void (*handler_)(int);
};

TEST_F(Image, FullDiskLeavesTheOldFile) {
    std::vector<float> noise(300 * 300 * 3);
    for (std::size_t i = 0; i < noise.size(); ++i)
        noise[i] = std::fmod(float(i) * 0.6180339F, 1.0F);
    for (const char* name : {"picture.exr", "picture.png"}) {
        write_image(folder_ / name, view_);
        const auto size = fs::file_size(folder_ / name);
        std::string text;
        {
            const FileSizeLimit limit(4096);
            text = refusal(folder_ / name, {noise.data(), 300, 300, 3});
        }
        EXPECT_EQ(text, "cannot write " + (folder_ / name).string() + ": File too large");
        EXPECT_EQ(fs::file_size(folder_ / name), size);
    }
    EXPECT_EQ(file_count(), 2U);
}

TEST_F(Image, DifferenceOfEqualPictures) {
    const ImageDifference same = compare_images(view_, view_);
    EXPECT_EQ(same.max, 0.0);
    EXPECT_EQ(same.mean, 0.0);
    EXPECT_EQ(same.rmse, 0.0);
    EXPECT_EQ(same.differing_pixels, 0U);
}

TEST_F(Image, DifferenceIsCounted) {
    std::vector<float> other = values_;
    other[0] += 3.0F;
    other[1] -= 4.0F;
    other[9] = std::nextafter(other[9], 1.0F);
    const ImageDifference found = compare_images(view_, {other.data(), 2, 2, 3});
    EXPECT_EQ(found.max, 4.0);
    EXPECT_NEAR(found.mean, 7.0 / 12.0, 1e-9);
    EXPECT_NEAR(found.rmse, 5.0 / std::sqrt(12.0), 1e-9);
    EXPECT_EQ(found.differing_pixels, 2U);
}

TEST_F(Image, NotANumberIsADifference) {
    std::vector<float> other = values_;
    other[4] = std::nanf("");
    const ImageView broken{other.data(), 2, 2, 3};
    EXPECT_EQ(compare_images(view_, broken).max, std::numeric_limits<double>::infinity());
    EXPECT_EQ(compare_images(view_, broken).differing_pixels, 1U);
    EXPECT_EQ(compare_images(broken, broken).differing_pixels, 0U);
}

TEST_F(Image, DifferentSizesCannotBeCompared) {
    EXPECT_THROW(compare_images(view_, {values_.data(), 4, 1, 3}), std::invalid_argument);
    EXPECT_THROW(compare_images(view_, {values_.data(), 4, 3, 1}), std::invalid_argument);
}

// --- the error of a noisy picture ----------------------------------------------------------------

/// A grey or colour picture that holds its values.
struct Held {
    std::vector<float> values;
    int width, height, channels;
    operator ImageView() const { return {values.data(), width, height, channels}; }
};

Held filled(const std::vector<float>& colour, int width = 20, int height = 10) {
    Held image{{}, width, height, int(colour.size())};
    for (int i = 0; i < width * height; ++i)
        image.values.insert(image.values.end(), colour.begin(), colour.end());
    return image;
}

TEST(ImageError, IsZeroForEqualPictures) {
    const Held image = filled({0.3F, 2.0F, 0.0F});
    const ImageError error = image_error(image, image);
    EXPECT_EQ(error.relative_mse, 0.0);
    EXPECT_EQ(error.mean_absolute, 0.0);
    EXPECT_EQ(error.root_mean_square, 0.0);
    EXPECT_EQ(error.peak_signal_to_noise, std::numeric_limits<double>::infinity());
    EXPECT_EQ(error.flip, 0.0);
    EXPECT_EQ(error.bias, 0.0);
}

TEST(ImageError, HasTheValuesOfItsFormulas) {
    const Held reference{{0.0F, 1.0F, 2.0F, 5.0F}, 2, 2, 1};  // mean 2: 0.01 m^2 is 0.04
    const Held picture{{0.5F, 1.0F, 1.0F, 6.0F}, 2, 2, 1};
    const ImageError error = image_error(picture, reference);
    EXPECT_NEAR(error.relative_mse, (0.25 / 0.04 + 1.0 / 4.04 + 1.0 / 25.04) / 4.0, 1e-12);
    EXPECT_NEAR(error.mean_absolute, 2.5 / 4.0, 1e-12);
    EXPECT_NEAR(error.root_mean_square, std::sqrt(2.25 / 4.0), 1e-12);
    EXPECT_NEAR(error.peak_signal_to_noise, 10.0 * std::log10(25.0 / (2.25 / 4.0)), 1e-12);
    EXPECT_NEAR(error.bias, 0.5 / 4.0 / 2.0, 1e-12);
}

TEST(ImageError, DoesNotDependOnTheUnitOfRadiance) {
    Held reference = filled({0.2F, 1.0F, 3.0F}), picture = filled({0.3F, 0.9F, 2.0F});
    const ImageError before = image_error(picture, reference);
    for (Held* image : {&reference, &picture})
        for (float& value : image->values) value = std::ldexp(value, 60);
    const ImageError after = image_error(picture, reference);
    EXPECT_DOUBLE_EQ(after.relative_mse, before.relative_mse);
    EXPECT_DOUBLE_EQ(after.peak_signal_to_noise, before.peak_signal_to_noise);
    EXPECT_DOUBLE_EQ(after.flip, before.flip);
    EXPECT_DOUBLE_EQ(after.bias, before.bias);
    EXPECT_DOUBLE_EQ(after.mean_absolute, std::ldexp(before.mean_absolute, 60));
}

TEST(ImageError, HidesNoValueThatIsNotFinite) {
    const Held reference = filled({1.0F, 1.0F, 1.0F});
    for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
        Held picture = reference;
        picture.values[7] = bad;
        const ImageError error = image_error(picture, reference);
        EXPECT_EQ(error.non_finite, 1U);
        for (const double value : {error.relative_mse, error.mean_absolute, error.root_mean_square,
                                   error.flip, error.bias, -error.peak_signal_to_noise})
            EXPECT_EQ(value, std::numeric_limits<double>::infinity());
    }
}

TEST(ImageError, JudgesAgainstBlack) {
    const Held black = filled({0.0F}), grey = filled({0.5F});
    EXPECT_EQ(image_error(black, black).relative_mse, 0.0);
    EXPECT_EQ(image_error(black, black).bias, 0.0);
    EXPECT_EQ(image_error(grey, black).relative_mse, std::numeric_limits<double>::infinity());
    EXPECT_EQ(image_error(grey, black).peak_signal_to_noise,
              -std::numeric_limits<double>::infinity());
    const Held white = filled({1.0F, 1.0F, 1.0F}), dark = filled({0.0F, 0.0F, 0.0F});
    EXPECT_NEAR(image_error(grey, black).flip, flip_map(white, dark)[0], 1e-6);
}

TEST(ImageError, NamesWhatItCannotJudge) {
    Held reference = filled({1.0F, 1.0F, 1.0F});
    const Held picture = reference;
    EXPECT_THROW(image_error(picture, filled({1.0F, 1.0F, 1.0F}, 10, 20)), std::invalid_argument);
    const Held with_alpha = filled({1.0F, 1.0F, 1.0F, 1.0F});
    EXPECT_THROW(image_error(with_alpha, with_alpha), std::invalid_argument);
    reference.values[(3 * 20 + 5) * 3 + 1] = -1.0F;
    try {
        image_error(picture, reference);
        FAIL() << "a negative reference was accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find("(5, 3) is -1"), std::string::npos)
            << error.what();
    }
}

/// Colours that fill the picture leave nothing to blur and no edges: FLIP is the distance of the
/// two colours. Black and white have L* 0 and 100 and no chroma; green and blue are farthest apart.
TEST(Flip, OfUniformColoursIsTheirDistance) {
    const auto flip = [](const std::vector<float>& a, const std::vector<float>& b) {
        const Held first = filled(a), second = filled(b);
        const Array<float> map = flip_map(first, second);
        for (const float value : map) EXPECT_NEAR(value, map[0], 1e-5F);
        return map[0];
    };
    const std::vector<float> green{0.0F, 1.0F, 0.0F}, blue{0.0F, 0.0F, 1.0F};
    EXPECT_NEAR(flip(green, blue), 1.0F, 1e-4F);
    EXPECT_EQ(flip(green, green), 0.0F);
    EXPECT_NEAR(flip(blue, green), flip(green, blue), 1e-6F);
    // HyAB with the Hunt effect, worked out by hand from L*a*b* of green (87.735, -86.183, 83.180)
    // and blue (32.299, 79.188, -107.860).
    const double most =
        std::pow((87.735 - 32.299) + std::hypot(0.01 * (87.735 * -86.183 - 32.299 * 79.188),
                                                0.01 * (87.735 * 83.180 + 32.299 * 107.860)),
                 0.7);
    const double bend = 0.4 * most, white = std::pow(100.0, 0.7);
    EXPECT_NEAR(flip({0.0F, 0.0F, 0.0F}, {1.0F, 1.0F, 1.0F}),
                0.95 + 0.05 * (white - bend) / (most - bend), 1e-4);
}

TEST(Flip, SeesALineMoreThanTheSameLightSpreadOut) {
    Held black = filled({0.0F, 0.0F, 0.0F}, 64, 64), line = black, haze = black;
    for (int y = 0; y < 64; ++y)
        for (int i = 0; i < 3; ++i) line.values[std::size_t((y * 64 + 32) * 3 + i)] = 0.64F;
    for (float& value : haze.values) value = 0.01F;
    const Array<float> sharp = flip_map(line, black), soft = flip_map(haze, black);
    EXPECT_GT(sharp[32 * 64 + 32], 3.0F * soft[32 * 64 + 32]);
    EXPECT_EQ(sharp[32 * 64], 0.0F);  // far from the line there is nothing
}

}  // namespace
}  // namespace bvhlab

#endif
