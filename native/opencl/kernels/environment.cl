// SPDX-License-Identifier: GPL-3.0-or-later
// A background with a texture: render/environment.h.

#ifdef ENVIRONMENT

static double2 equirectangular_from_direction(double3 direction) {
    const double height =
        atan2(direction.z, sqrt(direction.x * direction.x + direction.y * direction.y));
    return (double2)(0.5 - atan2(direction.y, direction.x) / (2.0 * PI), 0.5 + height / PI);
}

/// Sine of the angle to the pole, for v from 0 to 1.
static double sine_to_pole(double v) {
    return turn_of(PI * v).y;
}

static double3 direction_from_equirectangular(double2 uv) {
    const double2 around = turn_of((0.5 - uv.x) * 2.0 * PI), down = turn_of(PI * uv.y);
    return (double3)(down.y * around.x, down.y * around.y, -down.x);
}

static double3 to_texture(const Scene* scene, double3 direction) {
    global const double* m = scene->constants->to_texture;
    return times_d(load_d(m), load_d(m + 3), load_d(m + 6), direction);
}

/// By the transposed matrix.
static double3 from_texture(const Scene* scene, double3 direction) {
    global const double* m = scene->constants->to_texture;
    return (double3)(m[0] * direction.x + m[1] * direction.y + m[2] * direction.z,
                     m[3] * direction.x + m[4] * direction.y + m[5] * direction.z,
                     m[6] * direction.x + m[7] * direction.y + m[8] * direction.z);
}

static float3 environment_radiance_at(const Scene* scene, double2 uv) {
    const float3 factor = load_f(scene->constants->world, 0);
    const float4 texel = look_up(scene, scene->constants->world_texture, convert_float2(uv));
    return most_of_f(factor * texel.xyz, all_f(0.0F));
}

// --- density ------------------------------------------------------------------------------------

static long wrapped_index(long index, long count, bool repeats) {
    if (index >= 0 && index < count) return index;
    if (repeats) return (index + count) % count;
    return index < 0 ? 0 : count - 1;
}

static double wrapped_place(double place, double count, bool repeats) {
    if (place >= 0.0 && place < count) return place;
    if (repeats) return place < 0.0 ? place + count : place - count;
    return place < 0.0 ? -place : 2.0 * count - place;
}

static double weight_at(const Scene* scene, global const Texture* texture, long column, long row) {
    const bool repeats = texture->wrap == WRAP_REPEAT;
    const long width = texture->width;
    return (double)scene->environment_weights[wrapped_index(row, texture->height, repeats) * width +
                                              wrapped_index(column, width, repeats)];
}

static double interpolated_weight(const Scene* scene, double2 uv) {
    global const Texture* texture = scene->textures + scene->constants->world_texture;
    const double2 place =
        (double2)(uv.x * (double)texture->width, (1.0 - uv.y) * (double)texture->height);
    if (texture->closest)
        return weight_at(scene, texture, min((long)place.x, (long)texture->width - 1),
                         min((long)place.y, (long)texture->height - 1));
    const double2 corner = floor(place - 0.5);
    const double2 share = place - 0.5 - corner;
    const long column = (long)corner.x, row = (long)corner.y;
    const double above = mix_d(weight_at(scene, texture, column, row),
                               weight_at(scene, texture, column + 1, row), share.x);
    const double below = mix_d(weight_at(scene, texture, column, row + 1),
                               weight_at(scene, texture, column + 1, row + 1), share.x);
    return mix_d(above, below, share.y);
}

static double environment_pdf_at(const Scene* scene, double2 uv) {
    const double sine = sine_to_pole(uv.y);
    if (!(sine > 0.0)) return 0.0;
    global const Texture* texture = scene->textures + scene->constants->world_texture;
    const double texels = (double)texture->width * (double)texture->height;
    return interpolated_weight(scene, uv) * texels /
           (scene->constants->environment_weight * 2.0 * PI * PI * sine);
}

// --- what light sampling asks -------------------------------------------------------------------

static float3 environment_radiance(const Scene* scene, double3 direction) {
    return environment_radiance_at(scene,
                                   equirectangular_from_direction(to_texture(scene, direction)));
}

static double environment_pdf(const Scene* scene, double3 direction) {
    if (!(scene->constants->environment_weight > 0.0)) return 0.0;
    return environment_pdf_at(scene, equirectangular_from_direction(to_texture(scene, direction)));
}

/// Offset from a texel's centre, -1 to 1, with the density of the tent 1 - |offset|.
static double sample_tent(double random) {
    return random < 0.5 ? sqrt(2.0 * random) - 1.0 : 1.0 - sqrt(2.0 - 2.0 * random);
}

/// Texture coordinates drawn by the picture's luminance.
static double2 sample_environment(const Scene* scene, double2 random) {
    global const Texture* texture = scene->textures + scene->constants->world_texture;
    const ulong width = texture->width;
    const ulong stride = (width + WEIGHTS_PER_BLOCK - 1) / WEIGHTS_PER_BLOCK + 1;
    const WeightedChoice row = choose_from(scene, scene->constants->environment_rows, random.y);
    const WeightedChoice column =
        choose_by_weight(scene->environment_weights + row.index * width,
                         scene->environment_sums + row.index * stride, stride, random.x);
    double2 place = (double2)((double)column.index, (double)row.index);
    const bool repeats = texture->wrap == WRAP_REPEAT;
    if (texture->closest) {
        place += (double2)(column.rest, row.rest);
    } else {
        place += 0.5 + (double2)(sample_tent(column.rest), sample_tent(row.rest));
        place.x = wrapped_place(place.x, (double)texture->width, repeats);
        place.y = wrapped_place(place.y, (double)texture->height, repeats);
    }
    return (double2)(place.x / (double)texture->width, 1.0 - place.y / (double)texture->height);
}

#endif
