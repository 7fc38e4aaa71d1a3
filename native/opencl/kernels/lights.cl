// SPDX-License-Identifier: GPL-3.0-or-later
// Draws points of the lights of a scene and knows with which density: render/light_sampling.h.
//
// With COMPARED, the entries of the odds are each lamp, the emitters, each sun and the world; else
// all lamps, the emitters, all suns and the world. EMITTERS_ENTRY and WORLD_ENTRY say where.

// --- odds ---------------------------------------------------------------------------------------

#if defined(COMPARED) && defined(EMITTERS)
/// About the irradiance of all emitting triangles, as a ball that shines in all directions.
static double emitters_brightness(const Scene* scene, double3 position, double3 normal) {
    global const Constants* constants = scene->constants;
    if (constants->emitters == 0) return 0.0;
    const double3 to_centre = load_d(constants->emitters_centre) - position;
    const double squared = dot_d(to_centre, to_centre), radius = constants->emitters_radius;
    const double highest = dot_d(normal, to_centre) + radius;
    if (!is_zero_d(normal) && !(highest > 0.0)) return 0.0;
    return constants->emitters_power / (4.0 * PI * (squared + radius * radius));
}
#endif

static void add_odds(LightOdds* odds, uint entry, double weight) {
    odds->sums[entry + 1] = odds->sums[entry] + weight;
}

/// With which probabilities lights are drawn at a point.
CALLED LightOdds odds_at(const Scene* scene, double3 position, double3 normal) {
    LightOdds odds;
#ifdef COMPARED
#ifdef TRANSMISSION
    const double3 facing = all_d(0.0);
#else
    const double3 facing = normal;
#endif
    odds.sums[0] = 0.0;
#ifdef LAMPS
    for (uint i = 0; i < EMITTERS_ENTRY; ++i)
        add_odds(&odds, i, brightness_of(scene->lamps + i, position, facing));
#endif
#ifdef EMITTERS
    add_odds(&odds, EMITTERS_ENTRY, emitters_brightness(scene, position, facing));
#else
    add_odds(&odds, EMITTERS_ENTRY, 0.0);
#endif
#ifdef LAMPS
    for (uint i = EMITTERS_ENTRY + 1; i < WORLD_ENTRY; ++i)
        add_odds(&odds, i, brightness_of(scene->lamps + i - 1, position, facing));
#endif
    add_odds(&odds, WORLD_ENTRY, scene->constants->world_brightness);
#else
    for (uint i = 0; i <= ODDS_ENTRIES; ++i) odds.sums[i] = scene->constants->always[i];
#endif
    return odds;
}

// --- densities ----------------------------------------------------------------------------------

/// With which one sample finds an emitting triangle at this distance and cosine.
static double emitter_pdf(const Scene* scene, const LightOdds* odds, uint triangle, double distance,
                          double cosine) {
    const double density = scene->emitter_density[scene->material_index[triangle]];
    if (!(density > 0.0)) return 0.0;
    return odds_probability(odds, EMITTERS_ENTRY) * density * distance * distance / fabs(cosine);
}

static double world_pdf(const Scene* scene, const LightOdds* odds, double3 normal,
                        double3 direction) {
    const double probability = odds_probability(odds, WORLD_ENTRY);
#ifdef ENVIRONMENT
    return probability * environment_pdf(scene, direction);
#else
    return probability * most_d(0.0, dot_d(normal, direction)) / PI;
#endif
}

static float3 world_radiance(const Scene* scene, double3 direction) {
#ifdef ENVIRONMENT
    return environment_radiance(scene, direction);
#else
    return load_f(scene->constants->world, 0);
#endif
}

// --- samples ------------------------------------------------------------------------------------

#ifdef WORLD
static LightSample sample_world(const Scene* scene, const LightOdds* odds, double3 normal,
                                double2 random) {
#ifdef ENVIRONMENT
    const double2 uv = sample_environment(scene, random);
    const double3 direction = from_texture(scene, direction_from_equirectangular(uv));
    const double drawn = environment_pdf_at(scene, uv);
    if (!(drawn > 0.0)) return (LightSample){direction, all_d(0.0), 0.0, true};
    const double pdf = odds_probability(odds, WORLD_ENTRY) * drawn;
    const float3 radiance = environment_radiance_at(scene, uv);
#else
    const double3 direction = sample_cosine(normal, random);
    const double pdf = world_pdf(scene, odds, normal, direction);
    if (!(pdf > 0.0)) return (LightSample){direction, all_d(0.0), 0.0, true};
    const float3 radiance = load_f(scene->constants->world, 0);
#endif
    return (LightSample){direction, convert_double3(radiance) / pdf, pdf, true};
}
#endif

#ifdef EMITTERS
/// A point uniformly by area, a little off the triangle.
static LightSample sample_emitter(const Scene* scene, const LightOdds* odds, double3 position,
                                  double choice, double2 random) {
    const ulong chosen = choose_from(scene, scene->constants->emitters_by_power, choice).index;
    const uint triangle = scene->emitters[chosen];
    const double root = sqrt(random.x);
    const double u = root * (1.0 - random.y), v = root * random.y;
    const Corners corners = corners_of(scene, triangle);
    const SurfacePoint point = surface_point(corners, u, v, corners.a - position);
    LightSample sample = {point.position - position, all_d(0.0), 0.0, false};
    const double size = length_d(point.position) + length_d(sample.to_light);
    sample.to_light += END_CLEARANCE * size * point.normal;

    const double distance = length_d(sample.to_light);
    const double towards = -dot_d(sample.to_light, point.normal);
    if (!(distance > 0.0 && towards > 0.0)) return sample;
    sample.pdf = emitter_pdf(scene, odds, triangle, distance, towards / distance);
    const float2 uv = uv_at(scene, triangle, (float)u, (float)v);
    sample.irradiance = convert_double3(emission_at(scene, triangle, uv)) / sample.pdf;
    return sample;
}
#endif

#ifdef LAMPS
/// One of the lamps or suns that an entry of the odds stands for.
static LightSample sample_lamps(const Scene* scene, const LightOdds* odds, uint entry,
                                double choice, double3 position, double2 random) {
    double probability = odds_probability(odds, entry);
#ifdef COMPARED
    const uint chosen = entry > EMITTERS_ENTRY ? entry - 1 : entry;
#else
    global const Constants* constants = scene->constants;
    const bool sun = entry > EMITTERS_ENTRY;
    const Distribution by_power = sun ? constants->suns_by_power : constants->lamps_by_power;
    const ulong one = choose_from(scene, by_power, choice).index;
    probability *= probability_in(scene, by_power, one);
    const uint chosen = (uint)one + (sun ? constants->lamps : 0U);
#endif
    LightSample sample = sample_lamp(scene->lamps + chosen, position, random);
    sample.irradiance /= probability;
    sample.pdf *= scene->constants->extended > 0 ? probability : 0.0;
    return sample;
}
#endif

/// The sample `index` of `count` at a point. `odds` are those of position and normal, and there are
/// some; `choice` and `random` in [0, 1).
CALLED LightSample sample_lights(const Scene* scene, const LightOdds* odds, double3 position,
                                 double3 normal, uint index, uint count, double choice,
                                 double2 random) {
    const WeightedChoice chosen = choose_by_odds(odds, ((double)index + choice) / (double)count);
#ifdef WORLD
    if (chosen.index == WORLD_ENTRY) return sample_world(scene, odds, normal, random);
#endif
#ifdef EMITTERS
    if (chosen.index == EMITTERS_ENTRY)
        return sample_emitter(scene, odds, position, chosen.rest, random);
#endif
#ifdef LAMPS
    return sample_lamps(scene, odds, (uint)chosen.index, chosen.rest, position, random);
#endif
    return (LightSample){all_d(0.0), all_d(0.0), 0.0, false};
}
