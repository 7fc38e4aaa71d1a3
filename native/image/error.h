// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "image/image_view.h"

namespace bvhlab {

/// How wrong a noisy picture is. All values of all channels (x of the picture, r of the reference)
/// count alike; none is trimmed. m is the mean of the reference's.
///
/// A value that is not finite makes every measure infinitely bad (PSNR: minus infinity), and is
/// counted.
struct ImageError {
    /// Mean of (x - r)^2 / (r^2 + 0.01 m^2): the usual relMSE with its 0.01 in units of the mean,
    /// so that a scene twice as bright has the same error.
    double relative_mse = 0.0;
    double mean_absolute = 0.0;     ///< mean of |x - r|, in radiance
    double root_mean_square = 0.0;  ///< root of the mean of (x - r)^2, in radiance
    double peak_signal_to_noise =
        0.0;  ///< dB below the reference's largest value; infinite if equal
    /// Mean LDR-FLIP, 0 to 1 (flip.h), of both pictures after the same tone mapping: x / (x + m).
    /// 0 where it was not asked for.
    double flip = 0.0;
    double bias = 0.0;           ///< mean of x - r, in units of m
    std::size_t non_finite = 0;  ///< values of the picture that are NaN or infinite
};

inline constexpr double relative_mse_epsilon = 0.01;

/// Compares a picture with its reference. Throws std::invalid_argument where sizes or channels
/// differ, there are not 1 or 3 channels, or the reference holds a value that is not finite or is
/// negative. FLIP takes most of the time: a second for a million pixels.
ImageError image_error(const ImageView& picture, const ImageView& reference, bool with_flip = true);

}  // namespace bvhlab
