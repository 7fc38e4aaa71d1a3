// SPDX-License-Identifier: GPL-3.0-or-later
// Paths on their way through the stages: render/wave.h, and which samples they are.

/// trace/ray.h
typedef struct {
    float origin[3];
    float t_min;
    float direction[3];
    float t_max;
} PathRay;

/// A closest hit as opencl/trace.h gives it.
typedef struct {
    float t, u, v;
    uint triangle;
} PathHit;

/// What a path carries besides its ray.
typedef struct {
    float throughput[3];  ///< of light that comes along the ray; black: has ended
    float pdf;            ///< density of the direction; 0 where no light sample could find it
    float normal[3];      ///< of the surface that the path left, on the side it came from
    float travelled;      ///< since the last bounce, through surfaces passed straight through
} PathState;

/// render/film.h
typedef struct {
    float normal[3];
    float depth;
    float albedo[3];
    float node_visits, triangle_tests;
} PassValues;

/// The samples of a wave (render/film.h, PathRange), and how far it has come.
typedef struct {
    uint first_pixel, first_sample, samples, seed;
    uint depth, shadow_rays, bounce;
    uint last_direction;  ///< whether directions are drawn at the last bounce too
} WaveSettings;

static uint pixel_of(WaveSettings wave, uint id) {
    return wave.first_pixel + id / wave.samples;
}
static uint sample_of(WaveSettings wave, uint id) {
    return wave.first_sample + id % wave.samples;
}

static float3 vector_of(const float* values) {
    return (float3)(values[0], values[1], values[2]);
}

static PathRay ray_of(float3 origin, float3 direction, float t_max) {
    return (PathRay){
        {origin.x, origin.y, origin.z}, 0.0F, {direction.x, direction.y, direction.z}, t_max};
}

static PathState state_of(float3 throughput, float pdf, float3 normal, float travelled) {
    return (PathState){
        {throughput.x, throughput.y, throughput.z}, pdf, {normal.x, normal.y, normal.z}, travelled};
}
