// SPDX-License-Identifier: GPL-3.0-or-later
// What happens to a path where its ray ends: render/shade.h, a kernel for each of its steps.

// --- light that paths meet ----------------------------------------------------------------------

/// A path and what its ray has met.
typedef struct {
    float3 origin, direction, throughput, normal;
    float pdf, travelled;
    PathHit hit;
} Path;

static Path path_at(const PathRay* ray, const PathState* state, PathHit hit) {
    return (Path){vector_of(ray->origin),
                  vector_of(ray->direction),
                  vector_of(state->throughput),
                  vector_of(state->normal),
                  state->pdf,
                  state->travelled,
                  hit};
}

/// Weight of light found in a direction drawn with density `pdf`, by the power heuristic (Veach
/// 1997, section 9.2.4).
static float bsdf_weight(WaveSettings wave, float pdf, double light_pdf) {
    const double ratio = (double)wave.shadow_rays * light_pdf / (double)pdf;
    return (float)(1.0 / (1.0 + ratio * ratio));
}

/// With which lights were drawn at the point that the ray left.
static LightOdds odds_before(const Scene* scene, const Path* path) {
    const double3 behind = (double)path->travelled * convert_double3(path->direction);
    return odds_at(scene, convert_double3(path->origin) - behind, convert_double3(path->normal));
}

#ifdef WORLD
static float3 seen_world(const Scene* scene, WaveSettings wave, const Path* path) {
    const double3 direction = convert_double3(path->direction);
    const float3 radiance = world_radiance(scene, direction);
    if (path->pdf == 0.0F) return radiance;
    const LightOdds odds = odds_before(scene, path);
    const double light_pdf = world_pdf(scene, &odds, convert_double3(path->normal), direction);
    return radiance * bsdf_weight(wave, path->pdf, light_pdf);
}
#endif

#ifdef EMITTERS
static float3 seen_emission(const Scene* scene, WaveSettings wave, const Path* path) {
    const PathHit hit = path->hit;
    const float3 radiance =
        emission_at(scene, hit.triangle, uv_at(scene, hit.triangle, hit.u, hit.v));
    if (path->pdf == 0.0F || is_black(radiance)) return radiance;
    const double3 direction = convert_double3(path->direction);
    const SurfacePoint point = hit_point(scene, hit, direction);
    const double distance = (double)path->travelled + (double)hit.t;
    const LightOdds odds = odds_before(scene, path);
    const double light_pdf =
        emitter_pdf(scene, &odds, hit.triangle, distance, dot_d(point.normal, direction));
    return radiance * bsdf_weight(wave, path->pdf, light_pdf);
}
#endif

#ifdef LAMPS_MET
static float3 seen_lamps(const Scene* scene, WaveSettings wave, const Path* path) {
    const double3 direction = convert_double3(path->direction);
    const double travelled = (double)path->travelled;
    const double3 position = convert_double3(path->origin) - travelled * direction;
    const double t_max = travelled + (double)path->hit.t;
    LightOdds odds;
    bool odds_known = false;
    float3 radiance = all_f(0.0F);
    for (uint i = 0; i < scene->constants->extended; ++i) {
        const ExtendedLamp extended = scene->extended[i];
        LampHit met;
        if (!meet_lamp(scene->lamps + extended.lamp, position, direction, t_max, &met)) continue;
        if (!(met.distance > travelled && met.distance <= t_max)) continue;
        if (!odds_known) odds = odds_before(scene, path);
        odds_known = true;
        met.pdf *= extended.share * odds_probability(&odds, extended.entry);
        const float weight = path->pdf == 0.0F ? 1.0F : bsdf_weight(wave, path->pdf, met.pdf);
        radiance += convert_float3(met.radiance) * weight;
    }
    return radiance;
}
#endif

kernel void see(SCENE_ARGUMENTS,
                WaveSettings wave,               //
                uint count,                      // of paths that look
                global const uint* list,         // which; read only where `listed`
                uint listed,                     // else all paths from 0 on
                global const PathRay* rays,      // by path
                global const PathState* states,  // by path
                global const uint* ids,          // by path
                global const PathHit* hits,      // by path
                global float* radiance) {        // three by id: what the ray meets is added
    const uint j = get_global_id(0);
    if (j >= count) return;
    const uint i = listed ? list[j] : j;
    const Scene scene = SCENE;
    const PathRay ray = rays[i];
    const PathState state = states[i];
    const Path path = path_at(&ray, &state, hits[i]);
    float3 light = all_f(0.0F);
    if (path.hit.triangle == NO_TRIANGLE) {
#ifdef WORLD
        light = seen_world(&scene, wave, &path);
#endif
    } else {
#ifdef EMITTERS
        light = seen_emission(&scene, wave, &path);
#endif
    }
#ifdef LAMPS_MET
    if (wave.bounce > 0) light += seen_lamps(&scene, wave, &path);
#endif
    const uint id = ids[i];
    store_f(load_f(radiance, id) + path.throughput * light, radiance, id);
}

// --- scattering ---------------------------------------------------------------------------------

/// Share of the way at which shadow rays to a point end.
#define SHADOW_REACH (1.0F - 0x1p-24F)

/// The ray to the light that was sampled from a surface.
static PathRay ray_to_light(float3 origin, double3 position, const LightSample* light) {
    if (light->distant) return ray_of(origin, convert_float3(light->to_light), INFINITY);
    const double3 end = position + light->to_light;
    return ray_of(origin, convert_float3(end - convert_double3(origin)), SHADOW_REACH);
}

static PathRay shadow_ray(const Scene* scene, PathHit hit, const SurfacePoint* point, float3 normal,
                          const LightSample* light) {
#ifdef SMOOTH
    const bool reflects = dot_d(convert_double3(normal), light->to_light) >= 0.0;
    const double3 side = reflects ? point->normal : -point->normal;
    const double facing = dot_d(side, light->to_light) / length_d(light->to_light);
    const double3 start =
        point->position +
        terminator_lift(scene, hit, point->position, point->inside == reflects, facing, side);
    const float3 origin = offset_origin(start, point->normal, point->clearance, side);
    return ray_to_light(origin, point->position, light);
#else
    return ray_to_light(leaving(point, light->to_light), point->position, light);
#endif
}

/// Fills the light path at `place`, which is black until then, where the sample brings light.
static void sample_light(const Scene* scene, WaveSettings wave, const Path* path,
                         const SurfacePoint* point, float3 normal, const Bsdf* bsdf,
                         const LightSample* light, size_t place, global PathRay* light_rays,
                         global float* light_radiance) {
    const double count = (double)wave.shadow_rays;
    const double distance = length_d(light->to_light);
    if (!(distance > 0.0)) return;
    const BsdfValue value = evaluate(bsdf, convert_float3(light->to_light / distance));
    if (is_black(value.value)) return;
    const double density = count * light->pdf;
    const double ratio = density > 0.0 ? (double)value.pdf / density : 0.0;
    const float3 irradiance = convert_float3(light->irradiance / (count * (1.0 + ratio * ratio)));
    const PathRay ray = shadow_ray(scene, path->hit, point, normal, light);
    if (is_black(vector_of(ray.direction))) return;
    store_f(path->throughput * value.value * irradiance, light_radiance, place);
    light_rays[place] = ray;
}

kernel void scatter(SCENE_ARGUMENTS,
                    WaveSettings wave,             //
                    uint count,                    // of paths
                    global PathRay* rays,          // by path: the next ones, out
                    global PathState* states,      // by path: throughput black where it ends
                    global const uint* ids,        // by path
                    global const PathHit* hits,    // by path
                    global PathRay* light_rays,    // out, shadow_rays for each path
                    global float* light_radiance,  // out, three for each of them
                    global PassValues* passes) {   // by id; not read without PASSES
    const uint i = get_global_id(0);
    if (i >= count) return;
    const size_t first_light = (size_t)i * wave.shadow_rays;
    for (uint k = 0; k < wave.shadow_rays; ++k)
        store_f(all_f(0.0F), light_radiance, first_light + k);
    const PathRay ray = rays[i];
    PathState state = states[i];
    const Path path = path_at(&ray, &state, hits[i]);
    if (path.hit.triangle == NO_TRIANGLE) {
        states[i] = state_of(all_f(0.0F), state.pdf, path.normal, state.travelled);
        return;
    }

    // Find the surface.
    const Scene scene = SCENE;
    const PathHit hit = path.hit;
    const SurfacePoint point = hit_point(&scene, hit, convert_double3(path.direction));
    const float3 geometric = convert_float3(point.normal);
#ifdef SMOOTH
    const float3 normal = shading_normal(&scene, hit, &point);
#else
    const float3 normal = geometric;
#endif
    const uint id = ids[i];
    const Sampler random = sampler_of(pixel_of(wave, id), sample_of(wave, id), wave.seed);
    const uint dimension = bounce_dimension(wave.bounce, wave.shadow_rays);
    const double2 choice = random_pair(random, dimension + CHOICE_PAIR);
    const Bsdf bsdf = bsdf_at(&scene, scene.material_index[hit.triangle],
                              uv_at(&scene, hit.triangle, hit.u, hit.v), normal, geometric,
                              -path.direction, point.inside);
#ifdef PASSES
    if (wave.bounce == 0) {
        store_f(normal, passes[id].normal, 0);
        store_f(bsdf_albedo(&bsdf), passes[id].albedo, 0);
    }
#endif

    // Look for light.
    const float3 seen_normal = bsdf_normal(&bsdf);
#ifdef LIGHTS
    if (scatters(&bsdf) && !only_delta(&bsdf) && wave.shadow_rays > 0) {
        const double3 facing = convert_double3(seen_normal);
        const LightOdds odds = odds_at(&scene, point.position, facing);
        for (uint k = 0; k < wave.shadow_rays && !no_odds(&odds); ++k) {
            const LightSample light =
                sample_lights(&scene, &odds, point.position, facing, k, wave.shadow_rays, choice.y,
                              random_pair(random, dimension + FIRST_SHADOW_PAIR + k));
            sample_light(&scene, wave, &path, &point, normal, &bsdf, &light, first_light + k,
                         light_rays, light_radiance);
        }
    }
#endif

    // Go on.
    if (!scatters(&bsdf) || !(wave.bounce < wave.depth || wave.last_direction)) {
        states[i] = state_of(all_f(0.0F), state.pdf, path.normal, state.travelled);
        return;
    }
    const BsdfSample sample = sample_bsdf(
        &bsdf, convert_float2(random_pair(random, dimension + DIRECTION_PAIR)), (float)choice.x);
    rays[i] =
        ray_of(leaving(&point, convert_double3(sample.direction)), sample.direction, INFINITY);
    states[i] = state_of(path.throughput * sample.weight, sample.delta ? 0.0F : sample.pdf,
                         seen_normal, 0.0F);
}
