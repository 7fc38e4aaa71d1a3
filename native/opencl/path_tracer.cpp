// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/path_tracer.h"

#include <algorithm>
#include <stdexcept>

#include "opencl/scan.h"
#include "render/sampler.h"

namespace bvhlab::opencl {
namespace {

const char* name_of(Stage stage) {
    return stage_names[std::size_t(stage)];
}

ProgramSource camera_source(const Camera& camera) {
    return {{"vector.cl", "sampler.cl", "sample_shapes.cl", "path.cl", "camera.cl"},
            camera.lens_radius > 0.0 ? "-DLENS" : ""};
}

ProgramSource shade_source(const SceneBuffers& scene, bool passes) {
    return {{"vector.cl", "sampler.cl", "sample_shapes.cl", "path.cl", "scene.cl", "offset.cl",
             "texture.cl", "microfacet.cl", "bsdf.cl", "lobes.cl", "distribution.cl",
             "spherical_rectangle.cl", "lamp.cl", "environment.cl", "lights.cl", "shade.cl",
             "through.cl"},
            scene.options + (passes ? " -DPASSES" : "")};
}

DeviceCamera device_camera(const Camera& camera, const Raster& raster) {
    return {camera.to_world,
            camera.left,
            camera.right,
            camera.bottom,
            camera.top,
            camera.clip_start,
            camera.lens_radius,
            camera.focus_distance,
            camera.kind == CameraKind::perspective,
            raster.width,
            raster.height,
            0};
}

/// Whether directions drawn from a BSDF can find light, so that the last ones are traced too.
bool bsdf_finds_light(const Features& features) {
    return features.world || features.emitters || (features.gloss && features.lamps);
}

const View& checked(const View& view) {
    if (view.bvh.mesh != view.scene.mesh)
        throw std::invalid_argument("the tree and the scene are of different meshes");
    return view;
}

std::size_t light_paths(std::size_t paths, std::uint32_t shadow_rays) {
    return paths * std::max(1U, shadow_rays);
}

}  // namespace

double bytes_per_path(std::uint32_t shadow_rays, bool passes) {
    const double path = sizeof(Ray) + sizeof(PathState) + sizeof(std::uint32_t);
    const double hit = sizeof(Hit) + 1.0 + (passes ? 12.0 : 0.0);
    const double light = 2.0 * sizeof(Ray) + sizeof(glm::vec3) + 12.0 + hit;
    return 2.0 * path + hit + sizeof(glm::vec3) + (passes ? sizeof(PassValues) : 0.0) +
           light * std::max(1U, shadow_rays);
}

PathTracer::Paths::Paths(Commands& commands, std::size_t most)
    : rays(commands.buffer<Ray>(most)),
      states(commands.buffer<PathState>(most)),
      ids(commands.buffer<std::uint32_t>(most)) {}

PathTracer::PathTracer(Commands& commands, const View& view, std::shared_ptr<const DeviceTree> tree,
                       const TracerOptions& options, std::size_t most_paths)
    : view_(checked(view)),
      options_(options),
      tree_(std::move(tree)),
      lights_(view.scene),
      scene_(upload_scene(commands, view.scene, lights_)),
      last_direction_(bsdf_finds_light(view.scene.features)),
      camera_program_(commands.device(), camera_source(view.camera)),
      shade_program_(commands.device(), shade_source(scene_, options.passes)),
      wave_program_(commands.device(), {{"vector.cl", "path.cl", "wave.cl"}, ""}),
      paths_(commands, most_paths),
      spare_(commands, most_paths),
      radiance_(commands.buffer<glm::vec3>(most_paths)),
      passes_(commands.buffer<PassValues>(options.passes ? most_paths : 0)) {
    const std::size_t lights = light_paths(most_paths, options.paths.shadow_rays);
    const bool transparency = view.scene.features.transparency;
    hits_ = DeviceHits::with_rays(commands, most_paths, trace_options(false));
    gathered_hits_ = DeviceHits::with_rays(commands, lights, trace_options(!transparency));
    light_rays_ = commands.buffer<Ray>(lights);
    light_ = commands.buffer<glm::vec3>(lights);
    gathered_ = commands.buffer<Ray>(lights);
    marks_ = commands.buffer<std::uint32_t>(lights);
    list_ = commands.buffer<std::uint32_t>(lights);
    spare_list_ = commands.buffer<std::uint32_t>(transparency ? lights : 0);
    total_ = commands.buffer<std::uint32_t>(1);
}

template <class... Own>
void PathTracer::shade(const char* kernel, std::size_t items, const Own&... own) {
    const LightBuffers& lights = scene_.lights;
    commands_->run(shade_program_[kernel], items, scene_.constants, scene_.vertices,
                   scene_.triangles, scene_.material_index, scene_.materials, scene_.components,
                   scene_.lookups, scene_.textures, scene_.texture_bytes, scene_.texture_floats,
                   scene_.decoded, scene_.uvs, scene_.normals, scene_.energy, lights.lamps,
                   lights.extended, lights.emitters, lights.emitter_density, lights.weights,
                   lights.sums, lights.environment_weights, lights.environment_sums, own...);
}

void PathTracer::trace(Commands& commands, const PathRange& range) {
    commands_ = &commands;
    start(range);
    for (;; ++wave_.bounce) {
        trace_paths();
        if (wave_.bounce > options_.paths.depth) break;
        scatter();
        trace_light();
        keep_living();
        if (count_ == 0) break;
    }
}

/// Generates the camera rays.
void PathTracer::start(const PathRange& range) {
    wave_ = {std::uint32_t(range.first_pixel),
             range.first_sample,
             range.samples,
             view_.raster.seed,
             options_.paths.depth,
             options_.paths.shadow_rays,
             0,
             last_direction_};
    count_ = range.size();
    commands_->stage(name_of(Stage::generate));
    commands_->run(camera_program_["generate"], count_, device_camera(view_.camera, view_.raster),
                   wave_, std::uint32_t(count_), paths_.rays, paths_.states, paths_.ids, radiance_);
}

// --- rays of paths ------------------------------------------------------------------------------

TraceOptions PathTracer::trace_options(bool any_hit) const {
    TraceOptions options;
    options.any_hit = any_hit;
    options.count = options_.passes && wave_.bounce == 0 && !any_hit;
    options.reorder = options_.reorder;
    return options;
}

void PathTracer::trace_closest(const Buffer<Ray>& traced, std::size_t count,
                               const DeviceHits& hits) {
    const bool primary = wave_.bounce == 0, last = wave_.bounce > options_.paths.depth;
    const Stage stage = primary ? Stage::primary : last ? Stage::last : Stage::secondary;
    (primary ? rays.primary : last ? rays.last : rays.secondary) += count;
    TraceOptions options = trace_options(false);
    if (primary) options.reorder = Reorder::off;
    trace_rays(*commands_, *tree_, traced, count, options, name_of(stage), hits);
}

/// Adds the light that the rays of all paths meet, or of those that are listed.
void PathTracer::see(std::size_t count, const Buffer<std::uint32_t>* list) {
    commands_->stage(name_of(Stage::shade));
    shade("see", count, wave_, std::uint32_t(count), list ? *list : list_,
          std::uint32_t(list != nullptr), paths_.rays, paths_.states, paths_.ids, hits_.hits,
          radiance_);
}

/// Finds what the rays of all paths meet, and takes up the light that they see.
void PathTracer::trace_paths() {
    trace_closest(paths_.rays, count_, hits_);
    see(count_, nullptr);
    if (view_.scene.features.transparency) pass_through();
}

/// Lets paths go on through what they pass straight through, and makes the hits behind it theirs.
void PathTracer::pass_through() {
    const bool counted = trace_options(false).count;
    std::size_t waiting = count_;
    commands_->stage(name_of(Stage::shade));
    commands_->fill(marks_, std::uint32_t(1));
    waiting = list_marked(waiting, nullptr, list_);
    for (std::uint32_t layer = 0; layer < most_layers && waiting > 0; ++layer) {
        commands_->stage(name_of(Stage::shade));
        shade("pass_through", waiting, wave_, layer, std::uint32_t(waiting), list_, paths_.rays,
              paths_.states, paths_.ids, hits_.hits, marks_);
        waiting = list_marked(waiting, &list_, spare_list_);
        std::swap(list_, spare_list_);
        gather_rays(paths_.rays, waiting);
        trace_closest(gathered_, waiting, gathered_hits_);
        commands_->stage(name_of(Stage::shade));
        commands_->run(wave_program_["take_behind"], waiting, list_, std::uint32_t(waiting),
                       gathered_hits_.hits, gathered_hits_.node_visits,
                       gathered_hits_.triangle_tests, std::uint32_t(counted), hits_.hits,
                       hits_.node_visits, hits_.triangle_tests);
        see(waiting, &list_);
    }
}

void PathTracer::scatter() {
    commands_->stage(name_of(Stage::shade));
    if (wave_.bounce == 0 && options_.passes) fill_depth();
    shade("scatter", count_, wave_, std::uint32_t(count_), paths_.rays, paths_.states, paths_.ids,
          hits_.hits, light_rays_, light_, passes_);
}

void PathTracer::fill_depth() {
    commands_->run(wave_program_["fill_depth"], count_, paths_.states, hits_.hits,
                   hits_.node_visits, hits_.triangle_tests, std::uint32_t(count_), passes_);
}

// --- rays to lights -----------------------------------------------------------------------------

/// Turns the light paths that something blocks black, and adds up what is left.
void PathTracer::trace_light() {
    const std::size_t lights = count_ * options_.paths.shadow_rays;
    if (lights == 0 || !scene_.has_lights) return;
    commands_->stage(name_of(Stage::compact));
    commands_->run(wave_program_["mark_lit"], lights, light_, std::uint32_t(lights), marks_);
    const std::size_t chosen = list_marked(lights, nullptr, list_);
    if (view_.scene.features.transparency) {
        trace_light_through(chosen);
    } else if (chosen > 0) {
        gather_rays(light_rays_, chosen);
        rays.shadow += chosen;
        trace_rays(*commands_, *tree_, gathered_, chosen, trace_options(true),
                   name_of(Stage::shadow), gathered_hits_);
        commands_->stage(name_of(Stage::shade));
        commands_->run(wave_program_["block_light"], chosen, list_, gathered_hits_.occluded,
                       std::uint32_t(chosen), light_);
    }
    gather_light();
}

/// The same where surfaces may be passed straight through. A path that meets more than most_layers
/// of them is blocked.
void PathTracer::trace_light_through(std::size_t waiting) {
    TraceOptions options = trace_options(false);
    options.count = false;
    for (std::uint32_t layer = 0; waiting > 0; ++layer) {
        gather_rays(light_rays_, waiting);
        rays.shadow += waiting;
        trace_rays(*commands_, *tree_, gathered_, waiting, options, name_of(Stage::shadow),
                   gathered_hits_);
        commands_->stage(name_of(Stage::shade));
        shade("pass_shadow", waiting, std::uint32_t(waiting), list_, gathered_hits_.hits,
              std::uint32_t(layer == most_layers), light_rays_, light_, marks_);
        waiting = list_marked(waiting, &list_, spare_list_);
        std::swap(list_, spare_list_);
    }
}

void PathTracer::gather_light() {
    commands_->stage(name_of(Stage::shade));
    commands_->run(wave_program_["gather_light"], count_, paths_.ids, light_,
                   options_.paths.shadow_rays, std::uint32_t(count_), radiance_);
}

// --- compaction ---------------------------------------------------------------------------------

/// Lists what the first `count` marks mark, ascending: elements of `from`, or their indices.
/// Returns how many. The marks become their sums.
std::size_t PathTracer::list_marked(std::size_t count, const Buffer<std::uint32_t>* from,
                                    const Buffer<std::uint32_t>& list) {
    commands_->stage(name_of(Stage::compact));
    exclusive_scan(*commands_, marks_, count, total_);
    commands_->run(wave_program_["list_marked"], count, marks_, total_, std::uint32_t(count),
                   from ? *from : marks_, std::uint32_t(from != nullptr), list);
    return commands_->value(total_, 0);
}

/// Gathers the rays that are listed.
void PathTracer::gather_rays(const Buffer<Ray>& all, std::size_t count) {
    commands_->stage(name_of(Stage::compact));
    commands_->run(wave_program_["gather_rays"], count, all, list_, std::uint32_t(count),
                   gathered_);
}

void PathTracer::keep_living() {
    commands_->stage(name_of(Stage::compact));
    const auto count = std::uint32_t(count_);
    commands_->run(wave_program_["mark_living"], count_, paths_.states, count, marks_);
    exclusive_scan(*commands_, marks_, count_, total_);
    commands_->run(wave_program_["keep_living"], count_, marks_, total_, count, paths_.rays,
                   paths_.states, paths_.ids, spare_.rays, spare_.states, spare_.ids);
    count_ = commands_->value(total_, 0);
    std::swap(paths_, spare_);
}

}  // namespace bvhlab::opencl
