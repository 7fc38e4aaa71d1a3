// SPDX-License-Identifier: GPL-3.0-or-later
// Frames, Lambertian directions, GGX microfacets and Fresnel's equations in the frame of the
// shading normal: render/microfacet.h; and how much light a lobe keeps: render/energy.h.

// --- frames -------------------------------------------------------------------------------------

/// A right-handed frame about the unit vector z (Duff et al. 2017).
typedef struct {
    float3 x, y, z;
} Frame;

static Frame frame_about(float3 z) {
    const float sign = copysign(1.0F, z.z);
    const float a = divide(-1.0F, sign + z.z);
    const float b = z.x * z.y * a;
    Frame frame;
    frame.x = (float3)(1.0F + sign * z.x * z.x * a, sign * b, -sign * z.x);
    frame.y = (float3)(b, sign + z.y * z.y * a, -z.y);
    frame.z = z;
    return frame;
}

static float3 to_local(const Frame* frame, float3 v) {
    return (float3)(dot_f(v, frame->x), dot_f(v, frame->y), dot_f(v, frame->z));
}

static float3 to_world(const Frame* frame, float3 v) {
    return v.x * frame->x + v.y * frame->y + v.z * frame->z;
}

/// Unit direction about +z with density cos / pi (Shirley & Chiu 1997).
static float3 sample_cosine_local(float2 random) {
    const float2 square = 2.0F * random - 1.0F;
    if (square.x == 0.0F && square.y == 0.0F) return (float3)(0.0F, 0.0F, 1.0F);
    const bool wide = fabs(square.x) > fabs(square.y);
    const float radius = wide ? square.x : square.y;
    const float angle = wide ? PI_F / 4.0F * divide(square.y, square.x)
                             : PI_F / 2.0F - PI_F / 4.0F * divide(square.x, square.y);
    const float2 turn = convert_float2(turn_of((double)angle));
    return (float3)(radius * turn.x, radius * turn.y,
                    square_root(most_f(0.0F, 1.0F - radius * radius)));
}

#ifdef GLOSS

// --- GGX ----------------------------------------------------------------------------------------

#define LEAST_ALPHA 7e-4F

/// Trowbridge & Reitz 1975 (Walter et al. 2007, equation 33).
static float ggx_density(float3 h, float alpha) {
    const float squared = alpha * alpha;
    const float slope = h.x * h.x + h.y * h.y + h.z * h.z * squared;
    return divide(squared, PI_F * slope * slope);
}

/// cos * (1 + 2 Lambda), with Smith's Lambda for GGX (Heitz 2014, equation 72).
static float smith_term(float cosine, float alpha) {
    const float squared = cosine * cosine;
    return square_root(squared + alpha * alpha * (1.0F - squared));
}

static float masking(float cosine, float alpha) {
    return divide(2.0F * cosine, cosine + smith_term(cosine, alpha));
}

/// Height-correlated (Heitz 2014, equation 99).
static float masking_shadowing(float cos_o, float cos_i, float alpha) {
    return divide(2.0F * cos_o * cos_i,
                  cos_i * smith_term(cos_o, alpha) + cos_o * smith_term(cos_i, alpha));
}

/// A microfacet normal that o sees (Dupuy & Benyoub 2023).
static float3 sample_visible_normal(float3 o, float alpha, float2 random) {
    const float3 stretched = unit_f((float3)(alpha * o.x, alpha * o.y, o.z));
    const float angle = 2.0F * PI_F * random.x;
    const float2 turn = convert_float2(turn_of((double)angle));
    const float z = (1.0F - random.y) * (1.0F + stretched.z) - stretched.z;
    const float sine = square_root(clamp_f(1.0F - z * z, 0.0F, 1.0F));
    const float3 h = stretched + (float3)(sine * turn, z);
    return unit_f((float3)(alpha * h.x, alpha * h.y, most_f(h.z, 1e-9F)));
}

// --- Fresnel ------------------------------------------------------------------------------------

/// `eta`: index of refraction beyond the surface over that on the viewer's side.
static float dielectric_reflectance(float cosine, float eta) {
    const float squared = eta * eta - (1.0F - cosine * cosine);
    if (squared <= 0.0F) return 1.0F;
    const float beyond = square_root(squared);
    const float perpendicular = divide(cosine - beyond, cosine + beyond);
    const float parallel = divide(eta * eta * cosine - beyond, eta * eta * cosine + beyond);
    return 0.5F * (perpendicular * perpendicular + parallel * parallel);
}

/// Schlick 1994.
static float3 schlick(float3 f0, float cosine) {
    const float x = clamp_f(1.0F - cosine, 0.0F, 1.0F);
    const float x2 = x * x;
    return f0 + (1.0F - f0) * (x2 * x2 * x);
}

/// The refracted direction beyond a microfacet h with dot(o, h) > 0.
static float3 refracted(float3 o, float3 h, float eta) {
    const float cosine = dot_f(o, h);
    const float beyond = square_root(most_f(0.0F, eta * eta - (1.0F - cosine * cosine)));
    return unit_f(over_f((cosine - beyond) * h - o, eta));
}

// --- energy -------------------------------------------------------------------------------------
// `energy` holds the averages of reflecting microfacets by roughness, then tables of
// ENERGY_ROUGHNESSES rows of ENERGY_COSINES values; table 0 is the albedo of reflecting ones.

#define ENERGY_COSINES 32
#define ENERGY_ROUGHNESSES 48

CALLED float energy_at(const Scene* scene, uint table, float cosine, float roughness) {
    const float x = square_root(clamp_f(cosine, 0.0F, 1.0F)) * (float)(ENERGY_COSINES - 1);
    const float y = clamp_f(roughness, 0.0F, 1.0F) * (float)(ENERGY_ROUGHNESSES - 1);
    const int column = min((int)x, ENERGY_COSINES - 2), row = min((int)y, ENERGY_ROUGHNESSES - 2);
    const float across = x - (float)column, down = y - (float)row;
    global const float* near = scene->energy + ENERGY_ROUGHNESSES +
                               (size_t)table * (ENERGY_COSINES * ENERGY_ROUGHNESSES) +
                               row * ENERGY_COSINES + column;
    global const float* far = near + ENERGY_COSINES;
    const float first = near[0] + across * (near[1] - near[0]);
    return first + down * (far[0] + across * (far[1] - far[0]) - first);
}

static float average_energy_at(const Scene* scene, float roughness) {
    const float y = clamp_f(roughness, 0.0F, 1.0F) * (float)(ENERGY_ROUGHNESSES - 1);
    const int row = min((int)y, ENERGY_ROUGHNESSES - 2);
    const float first = scene->energy[row], second = scene->energy[row + 1];
    return first + (y - (float)row) * (second - first);
}

/// What light that is scattered more than once adds to a reflection (Kulla & Conty 2017, with
/// Turquin's 2019 shape).
static float3 multiple_scattering(const Scene* scene, float3 average, float cosine,
                                  float roughness) {
    const float kept = energy_at(scene, 0, cosine, roughness),
                mean_kept = average_energy_at(scene, roughness);
    const float3 share = quotients_f(average * mean_kept, 1.0F - average * (1.0F - mean_kept));
    return 1.0F + share * divide(1.0F - kept, kept);
}

#endif
