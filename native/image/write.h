// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "image/image_view.h"

namespace bvhlab {

/// Writes a picture in the format that the extension names: `.exr` as it is (linear, 32-bit float,
/// ZIP), `.png` as 8-bit sRGB, clipped to [0, 1], NaN black, alpha not multiplied in.
///
/// Writes a file beside `path` first and then renames it, so that `path` is either whole or
/// untouched. Throws std::invalid_argument for another extension or an empty picture, and
/// std::runtime_error naming the file and the reason where it cannot be written.
void write_image(const std::filesystem::path& path, const ImageView& image);

}  // namespace bvhlab
