// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/environment.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <span>

#include "base/parallel.h"
#include "scene/color.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

/// Offset from a texel's centre, -1 to 1, with the density of the tent 1 - |offset|.
double sample_tent(double random) {
    return random < 0.5 ? std::sqrt(2.0 * random) - 1.0 : 1.0 - std::sqrt(2.0 - 2.0 * random);
}

/// Sine of the angle to the pole, for v from 0 to 1.
double sine_to_pole(double v) {
    return std::sin(pi * v);
}

/// The texel that stands for index -1 or `count`: the picture's other side, or the edge again.
std::size_t wrapped(std::int64_t index, std::size_t count, bool repeats) {
    const auto end = std::int64_t(count);
    if (index >= 0 && index < end) return std::size_t(index);
    if (repeats) return std::size_t((index + end) % end);
    return index < 0 ? 0 : count - 1;
}

/// As `wrapped`, of a place in texels.
double wrapped(double place, double count, bool repeats) {
    if (place >= 0.0 && place < count) return place;
    if (repeats) return place < 0.0 ? place + count : place - count;
    return place < 0.0 ? -place : 2.0 * count - place;
}

}  // namespace

glm::dvec2 equirectangular_from_direction(const glm::dvec3& direction) {
    const double height = std::atan2(direction.z, std::hypot(direction.x, direction.y));
    return {0.5 - std::atan2(direction.y, direction.x) / (2.0 * pi), 0.5 + height / pi};
}

glm::dvec3 direction_from_equirectangular(const glm::dvec2& uv) {
    const double around = (0.5 - uv.x) * 2.0 * pi, sine = sine_to_pole(uv.y);
    return {sine * std::cos(around), sine * std::sin(around), -std::cos(pi * uv.y)};
}

Environment::Environment(const Scene& scene)
    : world_(&scene.world),
      texture_(scene.textures[scene.world.texture].get()),
      to_world_(glm::transpose(scene.world.to_texture)),
      width_(texture_->width),
      height_(texture_->height),
      weights_(width_ * height_),
      sums_(block_sum_count(width_) * height_) {
    // Weigh the texels, and sum them up row by row.
    const std::size_t stride = block_sum_count(width_);
    Array<double> row_sums(height_);
    parallel_for_each(height_, 16, Token(), [&](std::size_t row) {
        const double v = 1.0 - (double(row) + 0.5) / double(height_);
        const std::span<float> weights(&weights_[row * width_], width_);
        for (std::size_t column = 0; column < width_; ++column) {
            const glm::vec2 centre((double(column) + 0.5) / double(width_), v);
            const glm::vec3 texel = world_->color * glm::vec3(look_up(*texture_, centre));
            const double weight = luminance(glm::max(texel, 0.0F)) * sine_to_pole(v);
            weights[column] = std::min(float(weight), std::numeric_limits<float>::max());
        }
        sum_blocks(weights, {&sums_[row * stride], stride});
        row_sums[row] = sums_[(row + 1) * stride - 1];
    });

    double sines = 0.0;
    for (std::size_t row = 0; row < height_; ++row) {
        total_weight_ += row_sums[row];
        sines += sine_to_pole((double(row) + 0.5) / double(height_));
    }
    mean_luminance_ = total_weight_ / (sines * double(width_));
    if (!(total_weight_ > 0.0)) return;

    // Choose rows by their sums, scaled so that none is beyond float. Rounding them changes the
    // density by 2^-24 of itself.
    const double largest = *std::max_element(row_sums.begin(), row_sums.end());
    Array<float> row_weights(height_);
    for (std::size_t row = 0; row < height_; ++row)
        row_weights[row] = float(row_sums[row] / largest);
    rows_ = Distribution(std::move(row_weights));
}

glm::vec3 Environment::radiance(const glm::dvec3& direction) const {
    return radiance_at(equirectangular_from_direction(world_->to_texture * direction));
}

double Environment::pdf(const glm::dvec3& direction) const {
    if (!(total_weight_ > 0.0)) return 0.0;
    return pdf_at(equirectangular_from_direction(world_->to_texture * direction));
}

glm::vec3 Environment::radiance_at(const glm::dvec2& uv) const {
    return glm::max(world_->color * glm::vec3(look_up(*texture_, glm::vec2(uv))), 0.0F);
}

EnvironmentSample Environment::sample(const glm::dvec2& random) const {
    // Choose a texel.
    const std::size_t stride = block_sum_count(width_);
    const WeightedChoice row = rows_.choose(random.y);
    const WeightedChoice column = choose_by_weight({&weights_[row.index * width_], width_},
                                                   {&sums_[row.index * stride], stride}, random.x);

    // Choose a point around its centre.
    glm::dvec2 place(column.index, row.index);
    const bool repeats = texture_->wrap == Wrap::repeat;
    if (texture_->closest) {
        place += glm::dvec2(column.rest, row.rest);
    } else {
        place += 0.5 + glm::dvec2(sample_tent(column.rest), sample_tent(row.rest));
        place.x = wrapped(place.x, double(width_), repeats);
        place.y = wrapped(place.y, double(height_), repeats);
    }
    const glm::dvec2 uv(place.x / double(width_), 1.0 - place.y / double(height_));
    return {to_world_ * direction_from_equirectangular(uv), radiance_at(uv), pdf_at(uv)};
}

double Environment::weight(std::int64_t column, std::int64_t row) const {
    const bool repeats = texture_->wrap == Wrap::repeat;
    return double(
        weights_[wrapped(row, height_, repeats) * width_ + wrapped(column, width_, repeats)]);
}

double Environment::interpolated_weight(const glm::dvec2& uv) const {
    const glm::dvec2 place(uv.x * double(width_), (1.0 - uv.y) * double(height_));
    if (texture_->closest)
        return weight(std::min(std::int64_t(place.x), std::int64_t(width_) - 1),
                      std::min(std::int64_t(place.y), std::int64_t(height_) - 1));
    const glm::dvec2 corner = glm::floor(place - 0.5);
    const glm::dvec2 share = place - 0.5 - corner;
    const auto column = std::int64_t(corner.x), row = std::int64_t(corner.y);
    const double above = glm::mix(weight(column, row), weight(column + 1, row), share.x);
    const double below = glm::mix(weight(column, row + 1), weight(column + 1, row + 1), share.x);
    return glm::mix(above, below, share.y);
}

/// The picture, of area 1, covers a sphere whose circles of latitude shrink towards the poles.
double Environment::pdf_at(const glm::dvec2& uv) const {
    const double sine = sine_to_pole(uv.y);
    if (!(sine > 0.0)) return 0.0;
    const double texels = double(width_) * double(height_);
    return interpolated_weight(uv) * texels / (total_weight_ * 2.0 * pi * pi * sine);
}

}  // namespace bvhlab
