// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "opencl/film.h"
#include "opencl/path_tracer.h"
#include "render/renderer.h"

namespace bvhlab::opencl {

/// bvhlab::Renderer on a device: a picture that gets better the longer it runs, kept there and read
/// back when shown. Samples added one by one give the same picture, bit for bit, as all at once;
/// so do all trees and orders of rays. Stage times are the device's, without transfers.
class Renderer {
public:
    /// `tree` is the view's tree, uploaded; null: it is uploaded now. The view must outlive this;
    /// `threads` of the options is not used. `work_group`: work-items in a group, 0 as Commands
    /// has it; it does not change the picture. Throws std::invalid_argument where the tree is of
    /// another mesh than the scene, MemoryError where scene or film do not fit, Cancelled.
    Renderer(std::shared_ptr<Device> device, const View& view,
             std::shared_ptr<const DeviceTree> tree, const RenderOptions& options,
             const Token& token, std::size_t work_group = 0);

    /// Adds samples to every pixel; as bvhlab::Renderer::render(). Throws Error where the device
    /// fails.
    void render(std::uint32_t samples, Token& token);

    /// Samples that every pixel has. May be called while another thread renders.
    std::uint32_t samples() const;

    /// What is there so far. May be called while another thread renders.
    Picture picture() const;

private:
    void render_to(std::uint32_t target, Commands& commands, Token& token);
    PathRange next_range(std::uint32_t target);
    void finish(const PathRange& range, const Commands& commands, const StageSeconds& before);

    std::shared_ptr<Device> device_;
    std::size_t work_group_;
    std::size_t most_paths_;
    std::unique_ptr<PathTracer> tracer_;
    std::mutex rendering_;  ///< one at a time

    mutable std::mutex progress_;     ///< guards what follows
    Token never_;                     ///< is not cancelled: a range is added as a whole
    mutable Commands film_commands_;  ///< of the film alone
    Film film_;
    std::uint32_t samples_ = 0;  ///< of every pixel
    std::uint32_t pass_ = 0;     ///< samples that are being added to every pixel
    std::size_t front_ = 0;      ///< pixels that already have them
    double seconds_ = 0.0;
    RayCounts rays_;
    StageSeconds stages_{};
};

/// Renders `samples` samples of every pixel at once. Throws as Renderer.
Picture render(const std::shared_ptr<Device>& device, const View& view,
               std::shared_ptr<const DeviceTree> tree, std::uint32_t samples,
               const RenderOptions& options, Token& token);

}  // namespace bvhlab::opencl
