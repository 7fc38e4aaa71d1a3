// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "opencl/scene_buffers.h"
#include "opencl/trace.h"
#include "render/path_tracer.h"

namespace bvhlab::opencl {

// As kernels/path.cl and camera.cl declare them, member for member.

struct PathState {
    glm::vec3 throughput;
    float pdf;
    glm::vec3 normal;
    float travelled;
};

struct WaveSettings {
    std::uint32_t first_pixel, first_sample, samples, seed;
    std::uint32_t depth, shadow_rays, bounce, last_direction;
};

struct DeviceCamera {
    glm::dmat4 to_world;
    double left, right, bottom, top;
    double clip_start, lens_radius, focus_distance;
    std::uint32_t perspective, width, height, unused;
};

static_assert(sizeof(PathState) == 32 && sizeof(WaveSettings) == 32 && sizeof(DeviceCamera) == 200);
static_assert(sizeof(Ray) == 32 && sizeof(Hit) == 16);

/// Bytes of a device's memory that each path of a wave takes, about.
double bytes_per_path(std::uint32_t shadow_rays, bool passes);

/// bvhlab::PathTracer on a device: the same stages, random numbers and arithmetic. Its pictures
/// differ by rounding alone, as sine, cosine and arc tangent are computed otherwise than by the
/// host's library (kernels/vector.cl); everything else has the same bits, so that the rays of a
/// path are the host's until one of these rounds differently.
class PathTracer {
public:
    /// For waves of at most `most_paths` paths. `tree` is the view's tree, uploaded. Throws
    /// std::invalid_argument where the tree is of another mesh than the scene, MemoryError where
    /// scene or waves do not fit.
    PathTracer(Commands& commands, const View& view, std::shared_ptr<const DeviceTree> tree,
               const TracerOptions& options, std::size_t most_paths);

    /// Traces these paths. Throws Cancelled. Waits for all but the last commands; times are in
    /// stages named as stage_names.
    void trace(Commands& commands, const PathRange& range);

    /// Of the last trace(), by path of its range.
    const Buffer<glm::vec3>& radiance() const { return radiance_; }
    const Buffer<PassValues>& passes() const { return passes_; }

    /// Of all traces since construction.
    RayCounts rays;

private:
    /// Living paths, in ascending order of id; `count` of them.
    struct Paths {
        Buffer<Ray> rays;
        Buffer<PathState> states;
        Buffer<std::uint32_t> ids;

        Paths(Commands& commands, std::size_t most);
    };

    void start(const PathRange& range);
    void trace_paths();
    void trace_closest(const Buffer<Ray>& rays, std::size_t count, const DeviceHits& hits);
    void see(std::size_t count, const Buffer<std::uint32_t>* list);
    void pass_through();
    void scatter();
    void fill_depth();
    void trace_light();
    void trace_light_through(std::size_t waiting);
    void gather_light();
    void keep_living();
    std::size_t list_marked(std::size_t count, const Buffer<std::uint32_t>* from,
                            const Buffer<std::uint32_t>& list);
    void gather_rays(const Buffer<Ray>& rays, std::size_t count);
    TraceOptions trace_options(bool any_hit) const;

    /// Runs a kernel of kernels/shade.cl or through.cl: the scene's arguments come first.
    template <class... Own>
    void shade(const char* kernel, std::size_t items, const Own&... own);

    View view_;
    TracerOptions options_;
    std::shared_ptr<const DeviceTree> tree_;
    LightSampler lights_;
    SceneBuffers scene_;
    bool last_direction_;
    Program camera_program_, shade_program_, wave_program_;

    // One wave.
    WaveSettings wave_{};
    std::size_t count_ = 0;  ///< paths alive
    Paths paths_, spare_;
    DeviceHits hits_;          ///< of the paths' rays
    Buffer<Ray> light_rays_;   ///< shadow_rays for each path
    Buffer<glm::vec3> light_;  ///< what each of them brings
    Buffer<Ray> gathered_;     ///< rays that are listed
    DeviceHits gathered_hits_;
    Buffer<std::uint32_t> marks_, list_, spare_list_, total_;
    Buffer<glm::vec3> radiance_;  ///< gathered so far, by id
    Buffer<PassValues> passes_;   ///< by id, or empty
    Commands* commands_ = nullptr;
};

}  // namespace bvhlab::opencl
