// SPDX-License-Identifier: GPL-3.0-or-later
// All models of materials, as at most MOST_LOBES lobes: render/bsdf.h. Comes after bsdf.cl.

#ifdef GLOSS

// --- lobes --------------------------------------------------------------------------------------

enum LobeKind { LAMBERT, TRANSLUCENT, GLOSSY, METAL, COAT, GLASS, REFRACTION };

typedef struct {
    float3 reflection;    ///< factor of what is reflected
    float3 transmission;  ///< factor of what goes through; of a metal its normal reflectance
    int kind;
    float alpha;        ///< of GGX; 0: a mirror
    float eta;          ///< index of refraction beyond the surface, over the viewer's side
    float probability;  ///< with which sample_bsdf takes it
} Lobe;

typedef struct {
    Frame frame;
    float3 geometric;
    float3 viewer;  ///< in the frame; z > 0
    float3 albedo, diffuse;
    uint count;
    bool only_delta;
    Lobe lobes[MOST_LOBES];
} Bsdf;

#define LEAST_COSINE 1e-4F
#define LEAST_COAT_IOR 1.01F

static bool is_delta(const Lobe* lobe) {
    return lobe->kind != LAMBERT && lobe->kind != TRANSLUCENT && lobe->alpha == 0.0F;
}

static float reflection_alpha(float roughness) {
    const float alpha = roughness * roughness;
    return alpha < LEAST_ALPHA ? 0.0F : alpha;
}

static float glass_alpha(float roughness, float ior) {
    const float alpha = roughness * roughness;
    return alpha < LEAST_ALPHA || alpha * (ior - 1.0F) < 1e-4F ? 0.0F : alpha;
}

/// Chance that a dielectric microfacet of this reflectance is sampled as a mirror.
static float mirror_chance(const Lobe* lobe, float reflected) {
    if (reflected >= 1.0F) return 1.0F;
    if (lobe->kind == REFRACTION) return 0.0F;
    const float mirrored = reflected * mean(lobe->reflection);
    const float through = (1.0F - reflected) * mean(lobe->transmission);
    return mirrored + through > 0.0F ? divide(mirrored, mirrored + through) : reflected;
}

// --- building -----------------------------------------------------------------------------------

static void add_lobe(Bsdf* bsdf, Lobe lobe, float3 albedo) {
    lobe.probability = mean(albedo);
    if (!(lobe.probability > 0.0F)) return;
    bsdf->albedo += albedo;
    bsdf->only_delta = bsdf->only_delta && is_delta(&lobe);
    bsdf->lobes[bsdf->count++] = lobe;
}

static void add_metal(const Scene* scene, Bsdf* bsdf, float3 f0, float weight, float roughness) {
    const float alpha = reflection_alpha(roughness);
    float3 factor = all_f(weight);
    const float3 mean_reflectance = f0 + over_f(1.0F - f0, 21.0F);
    if (alpha > 0.0F)
        factor *= multiple_scattering(scene, mean_reflectance, bsdf->viewer.z, roughness);
    const float3 seen = most_of_f(schlick(f0, bsdf->viewer.z), mean_reflectance);
    add_lobe(bsdf, (Lobe){factor, f0, METAL, alpha, 1.0F, 0.0F}, weight * seen);
}

static void add_glossy(const Scene* scene, Bsdf* bsdf, float3 color, float weight,
                       float roughness) {
    const float alpha = reflection_alpha(roughness);
    float3 factor = weight * color;
    if (alpha > 0.0F) factor *= multiple_scattering(scene, color, bsdf->viewer.z, roughness);
    add_lobe(bsdf, (Lobe){factor, all_f(0.0F), GLOSSY, alpha, 1.0F, 0.0F}, weight * color);
}

static void add_glass(const Scene* scene, Bsdf* bsdf, int kind, float3 reflection,
                      float3 transmission, float roughness, const Component* component,
                      bool inside) {
    const float ior = component->ior;
    const float alpha = glass_alpha(roughness, ior);
    float factor = 1.0F;
    if (alpha > 0.0F && (kind == GLASS || !inside)) {
        const uint table = component->glass_table + (kind == GLASS ? inside ? 1 : 0 : 2);
        factor = divide(1.0F, energy_at(scene, table, bsdf->viewer.z, roughness));
    }
    const float eta = inside ? divide(1.0F, ior) : ior;
    const float reflected = kind == GLASS ? dielectric_reflectance(bsdf->viewer.z, eta) : 0.0F;
    add_lobe(bsdf, (Lobe){factor * reflection, factor * transmission, kind, alpha, eta, 0.0F},
             transmission * (1.0F - reflected) + reflection * reflected);
}

/// A mix as in Blender 4's node: metal, else glass, else a diffuse base under a dielectric coat.
static void add_principled(const Scene* scene, Bsdf* bsdf, const Component* component, float3 color,
                           float weight, float roughness, float2 uv, bool inside) {
    const float metallic = number_at(scene, component->metallic, uv);
    const float transmission = number_at(scene, component->transmission, uv);
    if (metallic > 0.0F) add_metal(scene, bsdf, color, weight * metallic, roughness);
    const float glass = weight * (1.0F - metallic) * transmission;
    if (glass > 0.0F) {
        const float3 root =
            (float3)(square_root(color.x), square_root(color.y), square_root(color.z));
        add_glass(scene, bsdf, GLASS, all_f(glass), glass * root, roughness, component, inside);
    }
    const float base = weight * (1.0F - metallic) * (1.0F - transmission);
    if (base == 0.0F) return;
    const float ior = component->coat_ior;
    if (ior < LEAST_COAT_IOR) {
        bsdf->diffuse += base * color;
        return;
    }
    const float alpha = reflection_alpha(roughness);
    const float albedo = alpha == 0.0F
                             ? dielectric_reflectance(bsdf->viewer.z, ior)
                             : energy_at(scene, component->coat_table, bsdf->viewer.z, roughness);
    add_lobe(bsdf, (Lobe){all_f(base), all_f(0.0F), COAT, alpha, ior, 0.0F}, all_f(base * albedo));
    bsdf->diffuse += base * (1.0F - albedo) * color;
}

static void add_component(const Scene* scene, Bsdf* bsdf, const Component* component, float2 uv,
                          bool inside) {
    const float weight = number_at(scene, component->weight, uv);
    if (weight == 0.0F || component->model == MODEL_TRANSPARENT) return;
    const float3 color = color_at(scene, component->color, uv, 1.0F);
    if (component->model == MODEL_DIFFUSE) {
        bsdf->diffuse += weight * color;
        return;
    }
    if (component->model == MODEL_TRANSLUCENT) {
        add_lobe(bsdf, (Lobe){weight * color, all_f(0.0F), TRANSLUCENT, 0.0F, 1.0F, 0.0F},
                 weight * color);
        return;
    }
    const float roughness = number_at(scene, component->roughness, uv);
    if (component->model == MODEL_PRINCIPLED)
        add_principled(scene, bsdf, component, color, weight, roughness, uv, inside);
    else if (component->model == MODEL_GLOSSY)
        add_glossy(scene, bsdf, color, weight, roughness);
    else if (component->model == MODEL_GLASS)
        add_glass(scene, bsdf, GLASS, weight * color, weight * color, roughness, component, inside);
    else
        add_glass(scene, bsdf, REFRACTION, all_f(0.0F), weight * color, roughness, component,
                  inside);
}

/// A shading normal that the viewer sees from below or at a grazing angle is tilted towards it.
static Frame frame_seen(float3 normal, float3 to_viewer) {
    const float cosine = dot_f(normal, to_viewer);
    if (cosine >= LEAST_COSINE) return frame_about(normal);
    return frame_about(unit_f(normal + (2.0F * LEAST_COSINE - cosine) * to_viewer));
}

CALLED Bsdf bsdf_at(const Scene* scene, uint material, float2 uv, float3 normal, float3 geometric,
                    float3 to_viewer, bool inside) {
    Bsdf bsdf;
    bsdf.frame = frame_seen(normal, to_viewer);
    bsdf.geometric = geometric;
    bsdf.viewer = to_local(&bsdf.frame, to_viewer);
    bsdf.viewer.z = clamp_f(bsdf.viewer.z, LEAST_COSINE, 1.0F);
    bsdf.albedo = bsdf.diffuse = all_f(0.0F);
    bsdf.count = 0;
    bsdf.only_delta = true;
    const uint first = scene->materials[material].first_component;
    const uint end = first + scene->materials[material].components;
    for (uint i = first; i < end; ++i) {
        const Component component = scene->components[i];
        add_component(scene, &bsdf, &component, uv, inside);
    }
    // All that is diffuse is one lobe.
    add_lobe(&bsdf, (Lobe){bsdf.diffuse, all_f(0.0F), LAMBERT, 0.0F, 1.0F, 0.0F}, bsdf.diffuse);
    float sum = 0.0F;
    for (uint i = 0; i < bsdf.count; ++i) sum += bsdf.lobes[i].probability;
    for (uint i = 0; i < bsdf.count; ++i)
        bsdf.lobes[i].probability = divide(bsdf.lobes[i].probability, sum);
    return bsdf;
}

// --- values -------------------------------------------------------------------------------------

CALLED BsdfValue reflect_lobe(const Lobe* lobe, float3 o, float3 i) {
    const float3 h = unit_f(o + i);
    const float density = divide(ggx_density(h, lobe->alpha), 4.0F * o.z);
    const float value = density * masking_shadowing(o.z, i.z, lobe->alpha);
    const float cosine = least_f(dot_f(o, h), 1.0F);
    float pdf = density * masking(o.z, lobe->alpha);
    float3 factor = lobe->reflection;
    if (lobe->kind == METAL) {
        factor *= schlick(lobe->transmission, cosine);
    } else if (lobe->kind == COAT) {
        factor *= dielectric_reflectance(cosine, lobe->eta);
    } else if (lobe->kind == GLASS) {
        const float reflected = dielectric_reflectance(cosine, lobe->eta);
        factor *= reflected;
        pdf *= mirror_chance(lobe, reflected);
    }
    return (BsdfValue){factor * value, pdf};
}

/// Walter et al. 2007, equations 16 and 17.
CALLED BsdfValue refract_lobe(const Lobe* lobe, float3 o, float3 i) {
    float3 h = unit_f(o + lobe->eta * i);
    if (h.z < 0.0F) h = -h;
    const float cos_o = dot_f(o, h), cos_i = dot_f(i, h);
    if (!(cos_o > 0.0F) || !(cos_i < 0.0F)) return no_value();
    const float reflected = dielectric_reflectance(least_f(cos_o, 1.0F), lobe->eta);
    const float share = lobe->kind == GLASS ? 1.0F - reflected : 1.0F;
    const float chance = 1.0F - mirror_chance(lobe, reflected);
    const float sum = cos_o + lobe->eta * cos_i;
    const float density = divide(
        ggx_density(h, lobe->alpha) * cos_o * -cos_i * lobe->eta * lobe->eta, o.z * sum * sum);
    return (BsdfValue){
        lobe->transmission * (share * density * masking_shadowing(o.z, -i.z, lobe->alpha)),
        chance * density * masking(o.z, lobe->alpha)};
}

static BsdfValue evaluate_lobe(const Lobe* lobe, float3 o, float3 i) {
    const bool above = i.z > 0.0F;
    if (lobe->kind == LAMBERT || lobe->kind == TRANSLUCENT) {
        const float pdf = divide(fabs(i.z), PI_F);
        if (above != (lobe->kind == LAMBERT)) return no_value();
        return (BsdfValue){lobe->reflection * pdf, pdf};
    }
    if (!(lobe->alpha > 0.0F)) return no_value();
    if (above) return lobe->kind == REFRACTION ? no_value() : reflect_lobe(lobe, o, i);
    return lobe->kind == GLASS || lobe->kind == REFRACTION ? refract_lobe(lobe, o, i) : no_value();
}

/// Whether light in this direction is on the same side of the triangle as of the shading normal.
static bool is_possible(const Bsdf* bsdf, float3 direction, float cosine) {
    return dot_f(bsdf->geometric, direction) * cosine > 0.0F;
}

CALLED BsdfValue evaluate_local(const Bsdf* bsdf, float3 light) {
    BsdfValue sum = no_value();
    for (uint i = 0; i < bsdf->count; ++i) {
        const BsdfValue one = evaluate_lobe(&bsdf->lobes[i], bsdf->viewer, light);
        sum.value += one.value;
        sum.pdf += bsdf->lobes[i].probability * one.pdf;
    }
    return sum;
}

static BsdfValue evaluate(const Bsdf* bsdf, float3 to_light) {
    const float3 light = to_local(&bsdf->frame, to_light);
    const bool possible = is_possible(bsdf, to_light, light.z);
    if (!possible && !(light.z > 0.0F)) return no_value();
    BsdfValue value = evaluate_local(bsdf, light);
    if (!possible) value.pdf = 0.0F;
    return value;
}

// --- directions ---------------------------------------------------------------------------------

/// Draws a direction of a lobe that is no delta; zero where a microfacet sends it nowhere.
static float3 sample_lobe(const Lobe* lobe, float3 o, float2 random, float choice) {
    if (lobe->kind == LAMBERT) return sample_cosine_local(random);
    if (lobe->kind == TRANSLUCENT) return -sample_cosine_local(random);
    const float3 h = sample_visible_normal(o, lobe->alpha, random);
    const float cosine = clamp_f(dot_f(o, h), 0.0F, 1.0F);
    if (lobe->kind == GLASS || lobe->kind == REFRACTION) {
        const float reflected = dielectric_reflectance(cosine, lobe->eta);
        if (reflected < 1.0F && choice >= mirror_chance(lobe, reflected)) {
            const float3 i = refracted(o, h, lobe->eta);
            return i.z < 0.0F ? i : all_f(0.0F);
        }
    }
    const float3 i = unit_f(2.0F * dot_f(o, h) * h - o);
    return i.z > 0.0F ? i : all_f(0.0F);
}

static BsdfSample sample_delta(const Bsdf* bsdf, const Lobe* lobe, float choice) {
    const float3 viewer = bsdf->viewer;
    float3 light = (float3)(-viewer.x, -viewer.y, viewer.z), weight = lobe->reflection;
    if (lobe->kind == METAL) weight *= schlick(lobe->transmission, viewer.z);
    if (lobe->kind == COAT) weight *= dielectric_reflectance(viewer.z, lobe->eta);
    if (lobe->kind == GLASS || lobe->kind == REFRACTION) {
        const float reflected = dielectric_reflectance(viewer.z, lobe->eta);
        const float chance = mirror_chance(lobe, reflected);
        if (reflected < 1.0F && choice >= chance) {
            light = refracted(viewer, (float3)(0.0F, 0.0F, 1.0F), lobe->eta);
            const float share = lobe->kind == GLASS ? 1.0F - reflected : 1.0F;
            weight = lobe->transmission * divide(share, 1.0F - chance);
        } else {
            weight *= divide(reflected, chance);
        }
    }
    const float3 direction = unit_f(to_world(&bsdf->frame, light));
    if (!is_possible(bsdf, direction, light.z)) weight = all_f(0.0F);
    return (BsdfSample){direction, over_f(weight, lobe->probability), 0.0F, true};
}

CALLED BsdfSample sample_bsdf(const Bsdf* bsdf, float2 random, float choice) {
    // Take the lobe, and use what is left of the random number within its share.
    uint taken = 0;
    float left = choice;
    while (taken + 1 < bsdf->count && left >= bsdf->lobes[taken].probability)
        left -= bsdf->lobes[taken++].probability;
    const Lobe lobe = bsdf->lobes[taken];
    const float rest = clamp_f(divide(left, lobe.probability), 0.0F, 1.0F);
    if (is_delta(&lobe)) return sample_delta(bsdf, &lobe, rest);

    // Draw a direction, and see which lobes could have drawn it.
    const float3 light = sample_lobe(&lobe, bsdf->viewer, random, rest);
    const BsdfSample nowhere = {bsdf->frame.z, all_f(0.0F), 0.0F, false};
    if (light.z == 0.0F) return nowhere;
    const float3 direction = unit_f(to_world(&bsdf->frame, light));
    if (!is_possible(bsdf, direction, light.z)) return nowhere;
    const BsdfValue value = evaluate_local(bsdf, light);
    if (!(value.pdf > 0.0F)) return nowhere;
    return (BsdfSample){direction, over_f(value.value, value.pdf), value.pdf, false};
}

static float3 bsdf_normal(const Bsdf* bsdf) {
    return bsdf->frame.z;
}
static float3 bsdf_albedo(const Bsdf* bsdf) {
    return bsdf->albedo;
}
static bool scatters(const Bsdf* bsdf) {
    return bsdf->count > 0;
}
static bool only_delta(const Bsdf* bsdf) {
    return bsdf->only_delta;
}

#endif
