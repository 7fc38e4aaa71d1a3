// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "scene/texture.h"

namespace bvhlab {

/// Reads a picture file through OpenImageIO: 8-bit values stay bytes, all others become float; rows
/// from the top; colour not multiplied by alpha. Of a grey picture with alpha all four channels are
/// kept, of more than four the first three and the one named alpha. The caller sets `srgb`, `wrap`
/// and `closest`.
/// Throws std::runtime_error naming the file and the reason where it cannot be read, or where a
/// side is longer than most_texels_a_side.
Texture read_texture(const std::filesystem::path& path);

}  // namespace bvhlab
