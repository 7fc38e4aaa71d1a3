// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "base/array.h"

namespace bvhlab {

/// A run of pixels, counted row by row from the top left, and a run of their samples. Its paths are
/// counted pixel by pixel, the samples of each in ascending order.
struct PathRange {
    std::size_t first_pixel, pixels;
    std::uint32_t first_sample, samples;

    std::size_t size() const { return pixels * samples; }
    std::uint32_t pixel(std::uint32_t path) const {
        return std::uint32_t(first_pixel + path / samples);
    }
    std::uint32_t sample(std::uint32_t path) const { return first_sample + path % samples; }
};

/// What the camera sees, besides light, where its ray first meets a surface that it does not pass
/// straight through.
struct PassValues {
    glm::vec3 normal;  ///< for shading, world space, on the viewer's side; 0 for a miss
    float depth;       ///< distance along the ray; infinite for a miss
    glm::vec3 albedo;  ///< 0 for a miss
    float node_visits, triangle_tests;  ///< that finding it took
};

/// A picture of what a film holds, row by row from the top left.
struct FilmPicture {
    Array<glm::vec3> pixels;          ///< mean radiance; black where there is no sample yet
    Array<glm::vec3> normal, albedo;  ///< mean; empty without passes, as are the others
    Array<float> depth;               ///< of the first sample
    Array<float> node_visits, triangle_tests;  ///< mean
};

/// Sums up samples. Each pixel's are added one by one in their order and in double, so that it does
/// not matter in which portions they arrive.
class Film {
public:
    Film(std::size_t pixels, bool passes);

    /// Adds the radiance of each path of the range, whose first sample must follow the last one of
    /// these pixels; and its pass values where the film has passes. Cannot be cancelled halfway.
    void add(const PathRange& range, std::span<const glm::vec3> radiance,
             std::span<const PassValues> passes);

    FilmPicture picture() const;

    std::size_t size() const { return radiance_.size(); }

    /// Bytes that film and picture take.
    static double bytes_per_pixel(bool passes);

private:
    struct PassSums {
        glm::dvec3 normal, albedo;
        double node_visits, triangle_tests;
        float depth;
    };

    Array<glm::dvec3> radiance_;    ///< sums, by pixel
    Array<std::uint32_t> samples_;  ///< by pixel
    Array<PassSums> passes_;        ///< by pixel, or empty
};

}  // namespace bvhlab
