// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/array.h"
#include "image/image_view.h"

namespace bvhlab {

/// Pixels in a degree of the viewer's sight: FLIP's default, a screen 0.7 m wide with 3840 pixels
/// seen from 0.7 m.
inline constexpr double flip_pixels_per_degree = 67.0206;

/// The perceived difference of two pictures at each pixel, 0 to 1: LDR-FLIP (Andersson et al.,
/// *FLIP: A Difference Evaluator for Alternating Images*, 2020), at `flip_pixels_per_degree`.
///
/// Both have the same size, three channels and linear values in [0, 1] as a screen shows them;
/// what lies outside is clipped. Returns width times height values, row by row. Runs in oneTBB; the
/// result does not depend on the number of threads.
Array<float> flip_map(const ImageView& picture, const ImageView& reference);

}  // namespace bvhlab
