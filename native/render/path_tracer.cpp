// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/path_tracer.h"

#include <limits>
#include <stdexcept>
#include <utility>

#include "base/parallel.h"
#include "render/compact.h"
#include "scene/color.h"

namespace bvhlab {
namespace {

constexpr std::size_t grain = 1024;
constexpr float infinity = std::numeric_limits<float>::infinity();

/// Adds the time of its life to a stage.
class Timed {
public:
    Timed(StageSeconds& seconds, Stage stage) : seconds_(seconds[std::size_t(stage)]) {}
    ~Timed() { seconds_ += watch_.seconds(); }

private:
    double& seconds_;
    Stopwatch watch_;
};

template <class T>
void append(Array<T>& to, std::span<const T> from) {
    to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

PathTracer::PathTracer(const View& view, const TracerOptions& options)
    : view_(view),
      options_(options),
      lights_(view.scene),
      shader_(view.scene, lights_, options.paths, view.raster.seed) {
    if (view.bvh.mesh != view.scene.mesh)
        throw std::invalid_argument("the tree and the scene are of different meshes");
}

void PathTracer::trace(const PathRange& range, Token& token, PathRays* record) {
    token_ = &token;
    record_ = record;
    start(range);
    for (;; ++wave_.bounce) {
        trace_paths();
        if (wave_.bounce > options_.paths.depth) break;
        scatter();
        trace_light();
        gather_light();
        keep_living();
        if (wave_.paths.size() == 0) break;
    }
}

/// Generates the camera rays.
void PathTracer::start(const PathRange& range) {
    const Timed timed(seconds, Stage::generate);
    wave_.range = range;
    wave_.bounce = 0;
    wave_.paths.resize(range.size());
    wave_.radiance.resize(range.size());
    wave_.passes.resize(options_.passes ? range.size() : 0);
    parallel_for_each(range.size(), grain, *token_, [&](std::size_t i) {
        const auto id = std::uint32_t(i);
        const CameraRay ray =
            camera_ray(view_.camera, view_.raster, range.pixel(id), range.sample(id));
        Paths& paths = wave_.paths;
        paths.origins[i] = ray.origin;
        paths.directions[i] = ray.direction;
        paths.throughput[i] = glm::vec3(1.0F);
        paths.normals[i] = glm::vec3(0.0F);
        paths.pdf[i] = 0.0F;
        paths.travelled[i] = 0.0F;
        paths.id[i] = id;
        wave_.radiance[i] = glm::vec3(0.0F);
    });
}

Hits PathTracer::trace_rays(const RayBatch& batch, bool any_hit, Stage stage,
                            std::uint64_t& count) {
    TraceOptions options;
    options.any_hit = any_hit;
    options.count = options_.passes && stage == Stage::primary;
    if (stage != Stage::primary) options.reorder = options_.reorder;
    Token part(token_);
    Hits hits = bvhlab::trace(view_.bvh, batch, options, part);
    count += batch.size();
    seconds[std::size_t(Stage::key)] += hits.key_seconds;
    seconds[std::size_t(Stage::sort)] += hits.sort_seconds;
    seconds[std::size_t(stage)] += hits.traverse_seconds;
    return hits;
}

Hits PathTracer::trace_closest(std::span<const glm::vec3> origins,
                               std::span<const glm::vec3> directions) {
    const std::uint32_t bounce = wave_.bounce, depth = options_.paths.depth;
    if (record_ && bounce <= depth) {
        RayArrays& kept = bounce == 0 ? record_->primary : record_->secondary[bounce - 1];
        append(kept.origins, origins);
        append(kept.directions, directions);
    }
    const float t_min = 0.0F;
    const RayBatch batch{origins, directions, {&t_min, 1}, {&infinity, 1}};
    if (bounce == 0) return trace_rays(batch, false, Stage::primary, rays.primary);
    if (bounce > depth) return trace_rays(batch, false, Stage::last, rays.last);
    return trace_rays(batch, false, Stage::secondary, rays.secondary);
}

/// Finds what the rays of all paths meet, and takes up the light that they see.
void PathTracer::trace_paths() {
    wave_.hits = trace_closest(wave_.paths.origins, wave_.paths.directions);
    {
        const Timed timed(seconds, Stage::shade);
        parallel_for_each(wave_.paths.size(), grain, *token_,
                          [&](std::size_t i) { shader_.see(wave_, i); });
    }
    if (view_.scene.features.transparency) pass_through();
}

/// Lets paths go on through what they pass straight through, and makes the hits behind it theirs. A
/// path that passes most_layers surfaces ends at the next one as if that were opaque.
void PathTracer::pass_through() {
    Array<std::uint32_t> waiting(wave_.paths.size());
    for (std::size_t i = 0; i < waiting.size(); ++i) waiting[i] = std::uint32_t(i);
    for (std::uint32_t layer = 0; layer < most_layers && !waiting.empty(); ++layer) {
        Array<std::uint8_t> passes(waiting.size());
        parallel_for_each(waiting.size(), grain, *token_, [&](std::size_t j) {
            passes[j] = shader_.pass_through(wave_, waiting[j], layer);
        });
        const Array<std::uint32_t> kept =
            compact(waiting.size(), *token_, [&](std::size_t j) { return passes[j] != 0; });
        Array<glm::vec3> origins(kept.size()), directions(kept.size());
        parallel_for_each(kept.size(), grain, *token_, [&](std::size_t j) {
            const std::uint32_t path = waiting[kept[j]];
            origins[j] = wave_.paths.origins[path];
            directions[j] = wave_.paths.directions[path];
        });
        const Hits behind = trace_closest(origins, directions);
        Hits& hits = wave_.hits;
        parallel_for_each(kept.size(), grain, *token_, [&](std::size_t j) {
            const std::uint32_t path = waiting[kept[j]];
            hits.t[path] = behind.t[j];
            hits.u[path] = behind.u[j];
            hits.v[path] = behind.v[j];
            hits.triangle[path] = behind.triangle[j];
            if (!behind.node_visits.empty()) {
                hits.node_visits[path] += behind.node_visits[j];
                hits.triangle_tests[path] += behind.triangle_tests[j];
            }
            shader_.see(wave_, path);
        });
        Array<std::uint32_t> still(kept.size());
        for (std::size_t j = 0; j < kept.size(); ++j) still[j] = waiting[kept[j]];
        waiting = std::move(still);
    }
}

void PathTracer::scatter() {
    const Timed timed(seconds, Stage::shade);
    if (wave_.bounce == 0 && options_.passes) fill_depth();
    wave_.light.resize(wave_.paths.size() * options_.paths.shadow_rays);
    parallel_for_each(wave_.paths.size(), grain, *token_, [&](std::size_t i) {
        shader_.prefetch(wave_, i);
        shader_.scatter(wave_, i);
    });
}

/// Pass values that tracing tells; shading adds the others where there is a surface.
void PathTracer::fill_depth() {
    const Hits& hits = wave_.hits;
    parallel_for_each(wave_.paths.size(), grain, *token_, [&](std::size_t i) {
        wave_.passes[i] = {glm::vec3(0.0F), wave_.paths.travelled[i] + hits.t[i], glm::vec3(0.0F),
                           float(hits.node_visits[i]), float(hits.triangle_tests[i])};
    });
}

Hits PathTracer::trace_shadow(const Array<std::uint32_t>& chosen, bool any_hit) {
    Array<glm::vec3> origins(chosen.size()), directions(chosen.size());
    Array<float> t_max(chosen.size());
    {
        const Timed timed(seconds, Stage::compact);
        parallel_for_each(chosen.size(), grain, *token_, [&](std::size_t j) {
            origins[j] = wave_.light.origins[chosen[j]];
            directions[j] = wave_.light.directions[chosen[j]];
            t_max[j] = wave_.light.t_max[chosen[j]];
        });
    }
    if (record_) {
        ShadowRays& kept = record_->shadow[wave_.bounce];
        append<glm::vec3>(kept.rays.origins, origins);
        append<glm::vec3>(kept.rays.directions, directions);
        append<float>(kept.t_max, t_max);
    }
    const float t_min = 0.0F;
    return trace_rays({origins, directions, {&t_min, 1}, t_max}, any_hit, Stage::shadow,
                      rays.shadow);
}

/// Turns the light paths that something blocks black.
void PathTracer::trace_light() {
    LightPaths& light = wave_.light;
    Array<std::uint32_t> chosen;
    {
        const Timed timed(seconds, Stage::compact);
        chosen = compact(light.size(), *token_,
                         [&](std::size_t j) { return !is_black(light.radiance[j]); });
    }
    if (view_.scene.features.transparency) return trace_light_through(std::move(chosen));
    const Hits hits = trace_shadow(chosen, true);
    parallel_for_each(chosen.size(), grain, *token_, [&](std::size_t j) {
        if (hits.occluded[j]) light.radiance[chosen[j]] = glm::vec3(0.0F);
    });
}

/// The same where surfaces may be passed straight through. A path that meets more than most_layers
/// of them is blocked.
void PathTracer::trace_light_through(Array<std::uint32_t> waiting) {
    LightPaths& light = wave_.light;
    for (std::uint32_t layer = 0; !waiting.empty(); ++layer) {
        const Hits hits = trace_shadow(waiting, false);
        parallel_for_each(waiting.size(), grain, *token_, [&](std::size_t j) {
            if (hits.triangle[j] == no_triangle) return;
            if (layer == most_layers)
                light.radiance[waiting[j]] = glm::vec3(0.0F);
            else
                shader_.pass_shadow(light, waiting[j], hits, j);
        });
        const Array<std::uint32_t> kept = compact(waiting.size(), *token_, [&](std::size_t j) {
            return hits.triangle[j] != no_triangle && !is_black(light.radiance[waiting[j]]);
        });
        Array<std::uint32_t> still(kept.size());
        for (std::size_t j = 0; j < kept.size(); ++j) still[j] = waiting[kept[j]];
        waiting = std::move(still);
    }
}

/// Adds up the light of each path in the order of its samples.
void PathTracer::gather_light() {
    const Timed timed(seconds, Stage::shade);
    const std::size_t count = options_.paths.shadow_rays;
    parallel_for_each(wave_.paths.size(), grain, *token_, [&](std::size_t i) {
        glm::vec3 sum(0.0F);
        for (std::size_t k = 0; k < count; ++k) sum += wave_.light.radiance[i * count + k];
        wave_.radiance[wave_.paths.id[i]] += sum;
    });
}

void PathTracer::keep_living() {
    const Timed timed(seconds, Stage::compact);
    const Array<std::uint32_t> kept = compact(wave_.paths.size(), *token_, [&](std::size_t i) {
        return !is_black(wave_.paths.throughput[i]);
    });
    spare_.resize(kept.size());
    parallel_for_each(kept.size(), grain, *token_,
                      [&](std::size_t i) { spare_.copy(wave_.paths, kept[i], i); });
    std::swap(wave_.paths, spare_);
}

}  // namespace bvhlab
