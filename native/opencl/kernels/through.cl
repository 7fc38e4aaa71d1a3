// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces that rays pass straight through: the part of render/shade.h that only scenes with
// TRANSPARENCY need.

#ifdef TRANSPARENCY

/// Probability of going straight on rather than scattering: in proportion to the light of each.
static double pass_probability(const Scene* scene, const Path* path, float3 share) {
    const PathHit hit = path->hit;
    const uint material = scene->material_index[hit.triangle];
    const float2 uv = uv_at(scene, hit.triangle, hit.u, hit.v);
#ifdef GLOSS
    const SurfacePoint point = hit_point(scene, hit, convert_double3(path->direction));
    const float3 normal = convert_float3(point.normal);
    const Bsdf bsdf = bsdf_at(scene, material, uv, normal, normal, -path->direction, point.inside);
    if (!scatters(&bsdf)) return 1.0;
    const float3 albedo = bsdf_albedo(&bsdf);
#else
    // One Lambertian lobe of all components.
    const float3 albedo = sum_of_colors(scene, material, uv, false);
    if (!(mean(albedo) > 0.0F)) return 1.0;
#endif
    const double through = luminance(share);
    const double scattered = most_d(luminance(albedo), 0.05 * through);
    return through / (through + scattered);
}

/// Decides which paths go straight through what their ray met, and moves their rays behind it; the
/// throughput of the others makes up for them.
kernel void pass_through(SCENE_ARGUMENTS,
                         WaveSettings wave,           //
                         uint layer,                  // surfaces passed since the last bounce
                         uint count,                  // of paths that may pass
                         global const uint* list,     // which
                         global PathRay* rays,        // by path
                         global PathState* states,    // by path
                         global const uint* ids,      // by path
                         global const PathHit* hits,  // by path
                         global uint* marks) {        // out, by list: 1 where it passes
    const uint j = get_global_id(0);
    if (j >= count) return;
    const uint i = list[j];
    const Scene scene = SCENE;
    const PathRay ray = rays[i];
    PathState state = states[i];
    const Path path = path_at(&ray, &state, hits[i]);
    const PathHit hit = path.hit;
    marks[j] = 0;
    if (hit.triangle == NO_TRIANGLE) return;
    const float3 share =
        straight_through(&scene, hit.triangle, uv_at(&scene, hit.triangle, hit.u, hit.v));
    if (is_black(share)) return;

    const double probability = pass_probability(&scene, &path, share);
    const uint id = ids[i];
    const Sampler random = sampler_of(pixel_of(wave, id), sample_of(wave, id), wave.seed);
    const double2 pair = random_pair(random, layer_dimension(wave.bounce, layer));
    if (pair.x >= probability) {
        const float3 throughput = over_f(path.throughput, (float)(1.0 - probability));
        states[i] = state_of(throughput, state.pdf, path.normal, state.travelled);
        return;
    }
    const double3 direction = convert_double3(path.direction);
    const SurfacePoint point = hit_point(&scene, hit, direction);
    states[i] = state_of(path.throughput * over_f(share, (float)probability), state.pdf,
                         path.normal, state.travelled + hit.t);
    rays[i] = ray_of(leaving(&point, direction), path.direction, INFINITY);
    marks[j] = 1;
}

/// By how much shorter each surface that it passes straight through makes a light path.
#define PASS_REACH 0x1p-22F

/// What is left of a light path behind what it met: to the light's point again, and a little
/// shorter for what rounding the direction moves that (Shader::pass_shadow).
static PathRay shadow_behind(const Scene* scene, PathHit hit, PathRay ray) {
    const float3 towards = vector_of(ray.direction);
    const double3 direction = convert_double3(towards);
    const double3 end = convert_double3(vector_of(ray.origin)) + direction;
    const SurfacePoint point = hit_point(scene, hit, direction);
    const float3 origin = leaving(&point, direction);
    if (ray.t_max == INFINITY) return ray_of(origin, towards, INFINITY);
    const float3 rest = convert_float3(end - convert_double3(origin));
    const bool arrived = dot_d(convert_double3(rest), direction) <= 0.0;
    return ray_of(origin, arrived ? towards : rest, arrived ? 0.0F : ray.t_max - PASS_REACH);
}

/// What of the light along light paths passes the surfaces that they met; those that go on are
/// moved to the other side.
kernel void pass_shadow(SCENE_ARGUMENTS,
                        uint count,                    // of light paths on their way
                        global const uint* list,       // which
                        global const PathHit* hits,    // by list
                        uint blocked,                  // 1: whatever they met blocks them
                        global PathRay* light_rays,    // by light path
                        global float* light_radiance,  // three by light path
                        global uint* marks) {          // out, by list: 1 where it goes on
    const uint j = get_global_id(0);
    if (j >= count) return;
    marks[j] = 0;
    const PathHit hit = hits[j];
    if (hit.triangle == NO_TRIANGLE) return;
    const uint i = list[j];
    if (blocked) {
        store_f(all_f(0.0F), light_radiance, i);
        return;
    }
    const Scene scene = SCENE;
    const float3 share =
        straight_through(&scene, hit.triangle, uv_at(&scene, hit.triangle, hit.u, hit.v));
    const float3 left = load_f(light_radiance, i) * share;
    store_f(left, light_radiance, i);
    marks[j] = is_black(left) ? 0 : 1;
    if (is_black(share)) return;
    light_rays[i] = shadow_behind(&scene, hit, light_rays[i]);
}

#endif
