// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/token.h"
#include "render/path_tracer.h"

namespace bvhlab {

/// The very rays that rendering traces for one sample of every pixel. The same scene, view and seed
/// give the same rays whatever the tree and threads. Throws Cancelled.
PathRays path_rays(const View& view, const PathSettings& paths, std::uint32_t sample, int threads,
                   Token& token);

/// Bytes a pixel that path_rays() takes at most, where no path ends early.
double path_rays_bytes(const PathSettings& paths);

}  // namespace bvhlab
