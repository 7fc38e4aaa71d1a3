// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/compare.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace bvhlab {
namespace {

double difference(float a, float b) {
    if (a == b || (std::isnan(a) && std::isnan(b))) return 0.0;
    const double distance = std::abs(double(a) - double(b));
    return std::isfinite(distance) ? distance : std::numeric_limits<double>::infinity();
}

std::string size_text(const ImageView& image) {
    return std::to_string(image.width) + " x " + std::to_string(image.height) + " with " +
           std::to_string(image.channels) + " channels";
}

}  // namespace

void check_same_size(const ImageView& a, const ImageView& b) {
    if (a.width != b.width || a.height != b.height || a.channels != b.channels)
        throw std::invalid_argument("pictures of different size cannot be compared: " +
                                    size_text(a) + " and " + size_text(b));
}

ImageDifference compare_images(const ImageView& a, const ImageView& b) {
    check_same_size(a, b);
    ImageDifference result;
    double sum = 0.0;
    double sum_of_squares = 0.0;
    const std::size_t channels = std::size_t(a.channels);
    for (std::size_t first = 0; first < a.value_count(); first += channels) {
        bool differs = false;
        for (std::size_t i = first; i < first + channels; ++i) {
            const double distance = difference(a.values[i], b.values[i]);
            differs |= distance != 0.0;
            sum += distance;
            sum_of_squares += distance * distance;
            result.max = std::max(result.max, distance);
        }
        result.differing_pixels += differs;
    }
    const double count = double(std::max<std::size_t>(a.value_count(), 1));
    result.mean = sum / count;
    result.rmse = std::sqrt(sum_of_squares / count);
    return result;
}

}  // namespace bvhlab
