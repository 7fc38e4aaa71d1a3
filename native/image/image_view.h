// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

namespace bvhlab {

/// A picture that someone else holds: linear float values, row by row from the top, channels
/// interleaved.
struct ImageView {
    const float* values;
    int width, height;
    int channels;  ///< 1 (grey), 3 (RGB) or 4 (RGB times alpha, alpha)

    std::size_t pixel_count() const { return std::size_t(width) * std::size_t(height); }
    std::size_t value_count() const { return pixel_count() * std::size_t(channels); }
};

}  // namespace bvhlab
