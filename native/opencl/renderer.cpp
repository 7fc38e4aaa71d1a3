// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/renderer.h"

#include <algorithm>
#include <utility>

#include "base/parallel.h"

namespace bvhlab::opencl {
namespace {

/// Samples that a pass adds to each pixel at most, so that a picture that is cancelled is complete.
constexpr std::uint32_t longest_pass = 16;

/// Light paths in a wave at most, so that no launch takes a second on a slow device.
constexpr std::size_t most_light_paths = std::size_t(1) << 18;

/// Share of a device's memory that a wave may take.
constexpr double share_of_memory = 1.0 / 8.0;

std::size_t pixel_count(const View& view) {
    return std::size_t(view.raster.width) * view.raster.height;
}

/// Paths in a wave: as wanted, but within these bounds.
std::size_t paths_in_wave(const DeviceInfo& device, const RenderOptions& options) {
    const TracerOptions& tracer = options.tracer;
    const double bytes = bytes_per_path(tracer.paths.shadow_rays, tracer.passes);
    const auto fitting = std::size_t(share_of_memory * double(device.memory) / bytes);
    const std::size_t brief = most_light_paths / std::max(1U, tracer.paths.shadow_rays);
    return std::max<std::size_t>(longest_pass, std::min({options.batch, fitting, brief}));
}

}  // namespace

Renderer::Renderer(std::shared_ptr<Device> device, const View& view,
                   std::shared_ptr<const DeviceTree> tree, const RenderOptions& options,
                   const Token& token, std::size_t work_group)
    : device_(std::move(device)),
      work_group_(work_group),
      most_paths_(paths_in_wave(device_->info(), options)),
      film_commands_(*device_, never_),
      film_(film_commands_, pixel_count(view), options.tracer.passes) {
    if (work_group_) film_commands_.work_group = work_group_;
    Commands commands(*device_, token);
    if (!tree) tree = upload_tree(commands, view.bvh);
    tracer_ =
        std::make_unique<PathTracer>(commands, view, std::move(tree), options.tracer, most_paths_);
    commands.finish();
}

std::uint32_t Renderer::samples() const {
    const std::lock_guard lock(progress_);
    return samples_;
}

Picture Renderer::picture() const {
    const std::lock_guard lock(progress_);
    return {film_.picture(film_commands_), samples_, rays_, stages_, seconds_};
}

void Renderer::render(std::uint32_t samples, Token& token) {
    const std::lock_guard lock(rendering_);
    const std::uint32_t target = added_samples(samples_, samples);
    token.begin("rendering");
    Commands commands(*device_, token);
    if (work_group_) commands.work_group = work_group_;
    render_to(target, commands, token);
}

/// The next wave on the way to `target` samples: first what is left of a pass, in the order of the
/// pixels.
PathRange Renderer::next_range(std::uint32_t target) {
    if (pass_ == 0) pass_ = std::min(longest_pass, target - samples_);
    const std::size_t most = std::max<std::size_t>(1, most_paths_ / pass_);
    return {front_, std::min(most, film_.size() - front_), samples_, pass_};
}

/// Takes the traced paths of `range` into the film; the commands' times are added to `before`.
void Renderer::finish(const PathRange& range, const Commands& commands,
                      const StageSeconds& before) {
    const std::lock_guard lock(progress_);
    film_.add(film_commands_, range, tracer_->radiance(), tracer_->passes());
    front_ += range.pixels;
    if (front_ == film_.size()) {
        samples_ += pass_;
        pass_ = 0;
        front_ = 0;
    }
    rays_ = tracer_->rays;
    for (std::size_t stage = 0; stage < stages_.size(); ++stage)
        stages_[stage] = before[stage] + commands.times().stage_seconds(stage_names[stage]);
    stages_[std::size_t(Stage::film)] =
        film_commands_.times().stage_seconds(stage_names[std::size_t(Stage::film)]);
}

void Renderer::render_to(std::uint32_t target, Commands& commands, Token& token) {
    const StageSeconds before = stages_;
    const double paths = double(target - samples_) * double(film_.size());
    double done = double(pass_) * double(front_);
    while (samples_ < target) {
        const Stopwatch watch;
        const PathRange range = next_range(target);
        tracer_->trace(commands, range);
        commands.finish();
        finish(range, commands, before);
        done += double(range.size());
        token.advance(float(std::min(1.0, done / paths)));
        const std::lock_guard lock(progress_);
        seconds_ += watch.seconds();
    }
}

Picture render(const std::shared_ptr<Device>& device, const View& view,
               std::shared_ptr<const DeviceTree> tree, std::uint32_t samples,
               const RenderOptions& options, Token& token) {
    Renderer renderer(device, view, std::move(tree), options, token);
    renderer.render(samples, token);
    return renderer.picture();
}

}  // namespace bvhlab::opencl
