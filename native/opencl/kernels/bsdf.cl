// SPDX-License-Identifier: GPL-3.0-or-later
// How a material scatters light at a point: render/bsdf.h. Here what all scenes need, and
// Lambertian reflection; all other models are in lobes.cl, which is there with GLOSS.

#define MODEL_PRINCIPLED 0U
#define MODEL_DIFFUSE 1U
#define MODEL_GLOSSY 2U
#define MODEL_GLASS 3U
#define MODEL_REFRACTION 4U
#define MODEL_TRANSLUCENT 5U
#define MODEL_TRANSPARENT 6U

typedef struct {
    float3 direction;  ///< unit length, away from the surface
    float3 weight;     ///< bsdf * |cosine| / pdf; black: the path ends
    float pdf;         ///< by solid angle, of all lobes together
    bool delta;        ///< a mirror or smooth glass
} BsdfSample;

typedef struct {
    float3 value;  ///< bsdf * |cosine|
    float pdf;
} BsdfValue;

static BsdfValue no_value(void) {
    return (BsdfValue){all_f(0.0F), 0.0F};
}

// --- what needs no lobes ------------------------------------------------------------------------

/// Radiance that a triangle's material emits: finite, not negative.
static float3 emission_at(const Scene* scene, uint triangle, float2 uv) {
    const ColorInput emission = scene->materials[scene->material_index[triangle]].emission;
    return color_at(scene, emission, uv, FLT_MAX);
}

/// Weighted colours of the components that are transparent, or of those that are not.
static float3 sum_of_colors(const Scene* scene, uint material, float2 uv, bool transparent) {
    const uint first = scene->materials[material].first_component;
    const uint end = first + scene->materials[material].components;
    float3 sum = all_f(0.0F);
    for (uint i = first; i < end; ++i) {
        const Component component = scene->components[i];
        if ((component.model == MODEL_TRANSPARENT) != transparent) continue;
        sum += number_at(scene, component.weight, uv) * color_at(scene, component.color, uv, 1.0F);
    }
    return sum;
}

/// Share of light that passes the triangle unscattered.
static float3 straight_through(const Scene* scene, uint triangle, float2 uv) {
    const uint material = scene->material_index[triangle];
    return least_of_f(sum_of_colors(scene, material, uv, true), all_f(1.0F));
}

static float mean(float3 color) {
    return (color.x + color.y + color.z) * (1.0F / 3.0F);
}

#ifndef GLOSS

// --- Lambertian reflection ----------------------------------------------------------------------

typedef struct {
    float3 color, normal, geometric;
} Bsdf;

CALLED Bsdf bsdf_at(const Scene* scene, uint material, float2 uv, float3 normal, float3 geometric,
                    float3 to_viewer, bool inside) {
    Bsdf bsdf;
    bsdf.color = least_of_f(sum_of_colors(scene, material, uv, false), all_f(1.0F));
    bsdf.normal = normal;
    bsdf.geometric = geometric;
    return bsdf;
}

static BsdfValue evaluate(const Bsdf* bsdf, float3 to_light) {
    const float cosine = dot_f(bsdf->normal, to_light);
    if (!(cosine > 0.0F)) return no_value();
    const bool drawn = dot_f(bsdf->geometric, to_light) > 0.0F;
    const float pdf = divide(cosine, PI_F);
    return (BsdfValue){bsdf->color * pdf, drawn ? pdf : 0.0F};
}

CALLED BsdfSample sample_bsdf(const Bsdf* bsdf, float2 random, float choice) {
    const float3 drawn = sample_cosine_local(random);
    const Frame frame = frame_about(bsdf->normal);
    const float3 direction = to_world(&frame, drawn);
    const bool seen = dot_f(bsdf->geometric, direction) > 0.0F && drawn.z > 0.0F;
    return (BsdfSample){direction, seen ? bsdf->color : all_f(0.0F), divide(drawn.z, PI_F), false};
}

static float3 bsdf_normal(const Bsdf* bsdf) {
    return bsdf->normal;
}
static float3 bsdf_albedo(const Bsdf* bsdf) {
    return bsdf->color;
}
static bool scatters(const Bsdf* bsdf) {
    return !is_black(bsdf->color);
}
static bool only_delta(const Bsdf* bsdf) {
    return false;
}

#endif
