// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>

#include "base/array.h"
#include "image/compare.h"
#include "image/flip.h"

namespace bvhlab {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

std::span<const float> values_of(const ImageView& image) {
    return {image.values, image.value_count()};
}

void check(const ImageView& picture, const ImageView& reference) {
    check_same_size(picture, reference);
    if (reference.channels != 1 && reference.channels != 3)
        throw std::invalid_argument(
            "the error of a picture is that of its colours: it needs 1 or "
            "3 channels, not " +
            std::to_string(reference.channels));
    const auto values = values_of(reference);
    const auto bad = std::find_if(values.begin(), values.end(),
                                  [](float value) { return !(value >= 0.0F && value < infinity); });
    if (bad == values.end()) return;
    const std::size_t pixel = std::size_t(bad - values.begin()) / std::size_t(reference.channels);
    throw std::invalid_argument("the reference cannot judge: pixel (" +
                                std::to_string(pixel % std::size_t(reference.width)) + ", " +
                                std::to_string(pixel / std::size_t(reference.width)) + ") is " +
                                std::to_string(*bad));
}

/// Three channels in [0, 1): x / (x + mean). Where the mean is 0, all that is not black is white.
Array<float> tone_mapped(const ImageView& image, double mean) {
    Array<float> result(image.pixel_count() * 3);
    const std::size_t channels = std::size_t(image.channels);
    for (std::size_t i = 0; i < result.size(); ++i) {
        const double value = image.values[channels == 3 ? i : i / 3];
        result[i] = value > 0.0 ? float(value / (value + mean)) : 0.0F;
    }
    return result;
}

double mean_flip(const ImageView& picture, const ImageView& reference, double mean) {
    const Array<float> shown = tone_mapped(picture, mean), truth = tone_mapped(reference, mean);
    const Array<float> map = flip_map({shown.data(), picture.width, picture.height, 3},
                                      {truth.data(), reference.width, reference.height, 3});
    return std::accumulate(map.begin(), map.end(), 0.0) / double(map.size());
}

ImageError infinitely_wrong(std::size_t non_finite) {
    return {infinity, infinity, infinity, -infinity, infinity, infinity, non_finite};
}

/// 0 / 0 is 0 here: a value that is right has no error.
double share(double part, double whole) {
    return part == 0.0 ? 0.0 : part / whole;
}

}  // namespace

ImageError image_error(const ImageView& picture, const ImageView& reference, bool with_flip) {
    check(picture, reference);
    const auto x = values_of(picture), r = values_of(reference);
    const auto non_finite =
        std::size_t(std::count_if(x.begin(), x.end(), [](float v) { return !std::isfinite(v); }));
    if (non_finite > 0) return infinitely_wrong(non_finite);

    const double count = double(std::max<std::size_t>(r.size(), 1));
    const double mean = std::accumulate(r.begin(), r.end(), 0.0) / count;
    const double peak = r.empty() ? 0.0 : double(*std::max_element(r.begin(), r.end()));
    double sum = 0.0, absolute = 0.0, squares = 0.0, relative = 0.0;
    for (std::size_t i = 0; i < r.size(); ++i) {
        const double truth = r[i], difference = double(x[i]) - truth;
        sum += difference;
        absolute += std::abs(difference);
        squares += difference * difference;
        relative +=
            share(difference * difference, truth * truth + relative_mse_epsilon * mean * mean);
    }
    ImageError error;
    error.relative_mse = relative / count;
    error.mean_absolute = absolute / count;
    error.root_mean_square = std::sqrt(squares / count);
    error.peak_signal_to_noise =
        squares == 0.0 ? infinity : 20.0 * std::log10(peak / error.root_mean_square);
    if (with_flip && !r.empty()) error.flip = mean_flip(picture, reference, mean);
    error.bias = share(sum / count, mean);
    return error;
}

}  // namespace bvhlab
