// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "image/image_view.h"

namespace bvhlab {

/// How far two pictures are apart. All are 0 exactly where the pictures are the same.
struct ImageDifference {
    double max = 0.0;   ///< greatest absolute difference of a value
    double mean = 0.0;  ///< mean absolute difference, over all values (pixels times channels)
    double rmse = 0.0;  ///< root of the mean squared difference, over all values
    std::size_t differing_pixels = 0;  ///< pixels with any value not equal
};

/// Compares two pictures of one size. A value that is not finite in one picture only is infinitely
/// far off: it must not go unseen. (OpenImageIO's own comparison counts such a pixel as equal.)
/// Throws std::invalid_argument where sizes or channels differ.
ImageDifference compare_images(const ImageView& a, const ImageView& b);

/// Throws std::invalid_argument naming both sizes where width, height or channels differ.
void check_same_size(const ImageView& a, const ImageView& b);

}  // namespace bvhlab
