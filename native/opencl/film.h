// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "opencl/commands.h"
#include "render/film.h"

namespace bvhlab::opencl {

/// A film on a device (bvhlab::Film): the same sums in the same order, read back when shown.
class Film {
public:
    Film(Commands& commands, std::size_t pixels, bool passes);

    /// Adds the radiance (and pass values, where the film has passes) of each path of the range,
    /// whose first sample must follow the last one of these pixels. Waits. The commands must not be
    /// cancelled: half of a range must never be added.
    void add(Commands& commands, const PathRange& range, const Buffer<glm::vec3>& radiance,
             const Buffer<PassValues>& passes);

    FilmPicture picture(Commands& commands) const;

    std::size_t size() const { return size_; }

private:
    static constexpr std::size_t sums_of_passes = 8;  ///< kernels/film.cl

    std::size_t size_;
    bool has_passes_;
    Buffer<double> radiance_;        ///< sums, three by pixel
    Buffer<std::uint32_t> samples_;  ///< by pixel
    Buffer<double> passes_;          ///< sums, sums_of_passes by pixel, or empty
    Buffer<float> depth_;            ///< of the first sample, by pixel, or empty
};

}  // namespace bvhlab::opencl
