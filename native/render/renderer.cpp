// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/renderer.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "base/parallel.h"

namespace bvhlab {
namespace {

/// Samples that a pass adds to each pixel at most, so that a picture that is cancelled is complete.
constexpr std::uint32_t longest_pass = 16;

std::size_t pixel_count(const View& view) {
    return std::size_t(view.raster.width) * view.raster.height;
}

}  // namespace

std::uint32_t added_samples(std::uint32_t present, std::uint32_t more) {
    if (present > most_samples || more > most_samples - present)
        throw std::invalid_argument("a picture has at most " + std::to_string(most_samples) +
                                    " samples a pixel; this one has " + std::to_string(present) +
                                    ", and " + std::to_string(more) + " more were asked for");
    return present + more;
}

double Picture::trace_seconds() const {
    double sum = 0.0;
    for (const Stage stage :
         {Stage::key, Stage::sort, Stage::primary, Stage::secondary, Stage::last, Stage::shadow})
        sum += stages[std::size_t(stage)];
    return sum;
}

Renderer::Renderer(const View& view, const RenderOptions& options)
    : options_(options),
      tracer_(view, options.tracer),
      film_(pixel_count(view), options.tracer.passes) {}

std::uint32_t Renderer::samples() const {
    const std::lock_guard lock(progress_);
    return samples_;
}

Picture Renderer::picture() const {
    const std::lock_guard lock(progress_);
    return {with_threads(options_.threads, [&] { return film_.picture(); }), samples_, rays_,
            stages_, seconds_};
}

void Renderer::render(std::uint32_t samples, Token& token) {
    const std::lock_guard lock(rendering_);
    const std::uint32_t target = added_samples(samples_, samples);
    token.begin("rendering");
    with_threads(options_.threads, [&] { render_to(target, token); });
}

/// The next batch on the way to `target` samples: first what is left of a pass, in the order of the
/// pixels.
PathRange Renderer::next_range(std::uint32_t target) {
    if (pass_ == 0) pass_ = std::min(longest_pass, target - samples_);
    const std::size_t most = std::max<std::size_t>(1, options_.batch / pass_);
    return {front_, std::min(most, film_.size() - front_), samples_, pass_};
}

/// Takes the traced paths of `range` into the film.
void Renderer::finish(const PathRange& range) {
    const Stopwatch watch;
    const std::lock_guard lock(progress_);
    film_.add(range, tracer_.radiance(), tracer_.passes());
    front_ += range.pixels;
    if (front_ == film_.size()) {
        samples_ += pass_;
        pass_ = 0;
        front_ = 0;
    }
    tracer_.seconds[std::size_t(Stage::film)] += watch.seconds();
    rays_ = tracer_.rays;
    stages_ = tracer_.seconds;
}

void Renderer::render_to(std::uint32_t target, Token& token) {
    const double paths = double(target - samples_) * double(film_.size());
    double done = double(pass_) * double(front_);
    while (samples_ < target) {
        const Stopwatch watch;
        const PathRange range = next_range(target);
        tracer_.trace(range, token);
        finish(range);
        done += double(range.size());
        token.advance(float(std::min(1.0, done / paths)));
        const std::lock_guard lock(progress_);
        seconds_ += watch.seconds();
    }
}

Picture render(const View& view, std::uint32_t samples, const RenderOptions& options,
               Token& token) {
    Renderer renderer(view, options);
    renderer.render(samples, token);
    return renderer.picture();
}

}  // namespace bvhlab
