// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/film.h"

#include <algorithm>

#include "base/parallel.h"

namespace bvhlab {
namespace {

constexpr std::size_t grain = 4096;

}  // namespace

Film::Film(std::size_t pixels, bool passes)
    : radiance_(pixels, glm::dvec3(0.0)), samples_(pixels, 0U) {
    if (passes) passes_ = Array<PassSums>(pixels, PassSums{});
}

void Film::add(const PathRange& range, std::span<const glm::vec3> radiance,
               std::span<const PassValues> passes) {
    parallel_for_each(range.pixels, grain, Token(), [&](std::size_t i) {
        const std::size_t pixel = range.first_pixel + i;
        for (std::size_t path = i * range.samples; path < (i + 1) * range.samples; ++path)
            radiance_[pixel] += glm::dvec3(radiance[path]);
        samples_[pixel] += range.samples;
        if (passes_.empty()) return;
        PassSums& sums = passes_[pixel];
        if (range.first_sample == 0) sums.depth = passes[i * range.samples].depth;
        for (std::size_t path = i * range.samples; path < (i + 1) * range.samples; ++path) {
            sums.normal += glm::dvec3(passes[path].normal);
            sums.albedo += glm::dvec3(passes[path].albedo);
            sums.node_visits += double(passes[path].node_visits);
            sums.triangle_tests += double(passes[path].triangle_tests);
        }
    });
}

FilmPicture Film::picture() const {
    FilmPicture picture{Array<glm::vec3>(size()), {}, {}, {}, {}, {}};
    const std::size_t passes = passes_.size();
    picture.normal.resize(passes);
    picture.albedo.resize(passes);
    picture.depth.resize(passes);
    picture.node_visits.resize(passes);
    picture.triangle_tests.resize(passes);
    parallel_for_each(size(), grain, Token(), [&](std::size_t i) {
        const double samples = std::max(1U, samples_[i]);
        picture.pixels[i] = glm::vec3(radiance_[i] / samples);
        if (passes == 0) return;
        picture.normal[i] = glm::vec3(passes_[i].normal / samples);
        picture.albedo[i] = glm::vec3(passes_[i].albedo / samples);
        picture.depth[i] = passes_[i].depth;
        picture.node_visits[i] = float(passes_[i].node_visits / samples);
        picture.triangle_tests[i] = float(passes_[i].triangle_tests / samples);
    });
    return picture;
}

double Film::bytes_per_pixel(bool passes) {
    const double sums = sizeof(glm::dvec3) + sizeof(std::uint32_t) + sizeof(glm::vec3);
    return sums + (passes ? sizeof(PassSums) + 2.0 * sizeof(glm::vec3) + 3.0 * sizeof(float) : 0.0);
}

}  // namespace bvhlab
