// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>

#include "base/token.h"
#include "render/film.h"
#include "render/path_tracer.h"

namespace bvhlab {

/// Largest number of samples a pixel, so that sums of sample counts fit in 32 bits.
inline constexpr std::uint32_t most_samples = 1U << 24;

/// The sum. Throws std::invalid_argument where a picture cannot have so many samples.
std::uint32_t added_samples(std::uint32_t present, std::uint32_t more);

struct RenderOptions {
    TracerOptions tracer;
    int threads = 0;  ///< 0: all
    /// Paths in a batch, which bounds memory to about 300 bytes a path with two shadow rays. It
    /// does not change the picture.
    std::size_t batch = std::size_t(1) << 16;
};

struct Picture {
    FilmPicture film;
    std::uint32_t samples = 0;  ///< that every pixel has
    RayCounts rays;
    StageSeconds stages{};
    double seconds = 0.0;          ///< wall-clock time of all rendering
    double trace_seconds() const;  ///< of which keys, sorting and traversal
};

/// Renders a picture that gets better the longer it runs. Samples added one by one give the same
/// picture, bit for bit, as all at once.
class Renderer {
public:
    /// Throws std::invalid_argument where the tree is of another mesh than the scene.
    Renderer(const View& view, const RenderOptions& options);

    /// Adds samples to every pixel. After Cancelled it keeps what was finished, which may leave the
    /// upper pixels with more samples than the lower ones; the next call first makes up for that.
    /// Throws std::invalid_argument beyond most_samples in all.
    void render(std::uint32_t samples, Token& token);

    /// Samples that every pixel has. May be called while another thread renders.
    std::uint32_t samples() const;

    /// What is there so far. May be called while another thread renders.
    Picture picture() const;

private:
    void render_to(std::uint32_t target, Token& token);
    PathRange next_range(std::uint32_t target);
    void finish(const PathRange& range);

    RenderOptions options_;
    PathTracer tracer_;
    std::mutex rendering_;  ///< one at a time

    mutable std::mutex progress_;  ///< guards what follows
    Film film_;
    std::uint32_t samples_ = 0;  ///< of every pixel
    std::uint32_t pass_ = 0;     ///< samples that are being added to every pixel
    std::size_t front_ = 0;      ///< pixels that already have them
    double seconds_ = 0.0;
    RayCounts rays_;
    StageSeconds stages_{};
};

/// Renders `samples` samples of every pixel at once. Throws Cancelled.
Picture render(const View& view, std::uint32_t samples, const RenderOptions& options, Token& token);

}  // namespace bvhlab
