// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/token.h"
#include "bvh/wide_bvh.h"
#include "render/camera_rays.h"
#include "render/light_sampling.h"
#include "render/shade.h"
#include "render/wave.h"
#include "scene/camera.h"
#include "scene/scene.h"
#include "trace/trace.h"

namespace bvhlab {

/// The steps of path tracing that are timed. Traversal is told apart by the kind of ray.
enum class Stage {
    generate,  ///< camera rays
    key,       ///< keys of rays to be reordered
    sort,
    primary,    ///< traversal of camera rays
    secondary,  ///< of rays that go on from a bounce
    last,       ///< of the rays after the last bounce, which only look for light
    shadow,     ///< of rays to lights
    shade,      ///< light seen, light samples, next directions
    compact,    ///< gathering what is alive
    film,
};
inline constexpr std::array<const char*, 10> stage_names{"generate",  "key",  "sort",   "primary",
                                                         "secondary", "last", "shadow", "shade",
                                                         "compact",   "film"};
using StageSeconds = std::array<double, stage_names.size()>;

/// Rays traced, by kind; each part of a ray between surfaces that it passes straight through
/// counts.
struct RayCounts {
    std::uint64_t primary = 0, secondary = 0, last = 0, shadow = 0;

    bool operator==(const RayCounts&) const = default;
};

/// Shadow rays, for any-hit queries with t_min = 0; directions run to a point of the light, or have
/// unit length towards a distant one.
struct ShadowRays {
    RayArrays rays;
    Array<float> t_max;
};

/// The rays of paths, in the order of the paths; none is dead. Primary and secondary rays have unit
/// directions, t_min = 0 and no end. The rays after the last bounce are not among them.
struct PathRays {
    RayArrays primary;
    std::vector<RayArrays> secondary;  ///< by bounce, from 1 to depth
    std::vector<ShadowRays> shadow;    ///< by bounce, from 0 to depth
};

/// What is to be rendered. All of it must outlive the path tracer.
struct View {
    const Bvh& bvh;
    const Scene& scene;
    const Camera& camera;
    Raster raster;
};

struct TracerOptions {
    PathSettings paths;
    Reorder reorder = Reorder::off;  ///< of secondary and shadow rays
    bool passes = false;             ///< fill pass values
};

/// Traces batches of paths in waves: one bounce of all paths after the other, one stage of all
/// after the other. What it computes depends on scene, view, paths and seed alone, bit for bit: not
/// on the tree, reordering, threads or how paths are batched.
class PathTracer {
public:
    /// Throws std::invalid_argument where the tree is of another mesh than the scene.
    PathTracer(const View& view, const TracerOptions& options);

    /// Traces these paths; `record`, unless null, receives their rays after those it has. Throws
    /// Cancelled.
    void trace(const PathRange& range, Token& token, PathRays* record = nullptr);

    /// Of the last trace(), by path of its range.
    std::span<const glm::vec3> radiance() const { return wave_.radiance; }
    std::span<const PassValues> passes() const { return wave_.passes; }

    /// Of all traces since construction.
    RayCounts rays;
    StageSeconds seconds{};

private:
    void start(const PathRange& range);
    void trace_paths();
    void pass_through();
    void scatter();
    void trace_light();
    void trace_light_through(Array<std::uint32_t> waiting);
    void gather_light();
    void keep_living();

    Hits trace_rays(const RayBatch& rays, bool any_hit, Stage stage, std::uint64_t& count);
    Hits trace_closest(std::span<const glm::vec3> origins, std::span<const glm::vec3> directions);
    Hits trace_shadow(const Array<std::uint32_t>& chosen, bool any_hit);
    void fill_depth();

    View view_;
    TracerOptions options_;
    LightSampler lights_;
    Shader shader_;
    Wave wave_;
    Paths spare_;  ///< of the last compaction
    Token* token_ = nullptr;
    PathRays* record_ = nullptr;
};

}  // namespace bvhlab
