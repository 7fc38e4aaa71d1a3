// SPDX-License-Identifier: GPL-3.0-or-later
// A scene on the device, member for member as opencl/scene_buffers.h and light_buffers.h upload it.

#define NO_LOOKUP 0xFFFFFFFFU
#define NO_TABLE 0xFFFFFFFFU

typedef struct {
    ulong first;  ///< of its values, in texture_bytes or texture_floats
    uint width, height, channels;
    uint has_bytes, srgb, closest, wrap;
    uint unused;
} Texture;

/// offset + scale * texel; `mapping` by columns.
typedef struct {
    uint texture, channel;
    float scale[3], offset[3], mapping[6];
} Lookup;

typedef struct {
    float value;
    uint lookup;
} NumberInput;

typedef struct {
    float value[3];
    uint lookup;
} ColorInput;

/// scene/material.h
typedef struct {
    uint model;
    NumberInput weight;
    ColorInput color;
    NumberInput roughness, metallic, transmission;
    float ior;
    float coat_ior;    ///< whose normal reflectance is scaled by `specular`
    uint coat_table;   ///< of energy; NO_TABLE where the coat is left out
    uint glass_table;  ///< first of three: from outside, from inside, refraction from outside
} Component;

typedef struct {
    uint first_component, components;
    ColorInput emission;
} Material;

/// render/lamp.h
typedef struct {
    double centre[3], back[3], edge_x[3], edge_y[3], unit_x[3], unit_y[3], size[2], strength[3];
    double reach, extent, luminance, spot_edge, spot_blended;
    uint kind, ellipse, right_angled, unused;
} Lamp;

/// A lamp that rays can meet.
typedef struct {
    double share;  ///< of the samples of its entry of the odds
    uint lamp, entry;
} ExtendedLamp;

/// Where in light_weights and light_sums a distribution is.
typedef struct {
    ulong first_weight, first_sum, sums;
} Distribution;

/// What there is once in a scene.
typedef struct {
    double emitters_centre[3];
    double emitters_power, emitters_radius;
    double world_brightness;
    double always[5];           ///< sums of the odds by power alone
    double to_texture[9];       ///< of the world, by columns
    double environment_weight;  ///< of all texels
    Distribution lamps_by_power, suns_by_power, emitters_by_power, environment_rows;
    float world[3];
    uint world_texture;
    uint lamps, suns;  ///< which follow the lamps
    uint emitters, extended;
} Constants;

// --- arguments ----------------------------------------------------------------------------------

/// All of a scene, as the first arguments of every kernel that shades. What a scene does not have
/// is an array of one element that is not read.
#define SCENE_ARGUMENTS                                                                            \
    global const Constants *constants, global const float *vertices, /* three for each */          \
        global const uint *triangles,                                /* three vertices for each */ \
        global const uint *material_index,                           /* by triangle */             \
        global const Material *materials,                            /* by material_index */       \
        global const Component *components,                          /* of all materials */        \
        global const Lookup *lookups,                                /* of inputs of materials */  \
        global const Texture *textures,          /* of look-ups and the world */                   \
        global const uchar *texture_bytes,       /* of all textures that have bytes */             \
        global const float *texture_floats,      /* of all others, linear and finite */            \
        global const float *decoded,             /* 257 linear values of sRGB bytes */             \
        global const float *uvs,                 /* two for each corner of each triangle */        \
        global const float *normals,             /* three for each corner of each triangle */      \
        global const float *energy,              /* tables, see energy_at; averages come first */  \
        global const Lamp *lamps,                /* and then suns */                               \
        global const ExtendedLamp *extended,     /* in the order of the scene's lights */          \
        global const uint *emitters,             /* emitting triangles */                          \
        global const double *emitter_density,    /* of a sample's point, by material */            \
        global const float *light_weights,       /* of distributions */                            \
        global const double *light_sums,         /* of their blocks */                             \
        global const float *environment_weights, /* by texel, row by row */                        \
        global const double *environment_sums    /* block sums of each row */

typedef struct {
    global const Constants* constants;
    global const float* vertices;
    global const uint* triangles;
    global const uint* material_index;
    global const Material* materials;
    global const Component* components;
    global const Lookup* lookups;
    global const Texture* textures;
    global const uchar* texture_bytes;
    global const float* texture_floats;
    global const float* decoded;
    global const float* uvs;
    global const float* normals;
    global const float* energy;
    global const Lamp* lamps;
    global const ExtendedLamp* extended;
    global const uint* emitters;
    global const double* emitter_density;
    global const float* light_weights;
    global const double* light_sums;
    global const float* environment_weights;
    global const double* environment_sums;
} Scene;

/// The struct of SCENE_ARGUMENTS.
#define SCENE                                                  \
    ((Scene){constants,       vertices,   triangles,           \
             material_index,  materials,  components,          \
             lookups,         textures,   texture_bytes,       \
             texture_floats,  decoded,    uvs,                 \
             normals,         energy,     lamps,               \
             extended,        emitters,   emitter_density,     \
             light_weights,   light_sums, environment_weights, \
             environment_sums})

// --- geometry -----------------------------------------------------------------------------------

typedef struct {
    double3 a, b, c;
} Corners;

static Corners corners_of(const Scene* scene, uint triangle) {
    const uint3 at = vload3(triangle, scene->triangles);
    return (Corners){convert_double3(load_f(scene->vertices, at.x)),
                     convert_double3(load_f(scene->vertices, at.y)),
                     convert_double3(load_f(scene->vertices, at.z))};
}

/// Texture coordinates at barycentrics u, v of a triangle; 0 where nothing is looked up.
static float2 uv_at(const Scene* scene, uint triangle, float u, float v) {
#ifdef TEXTURES
    const size_t corner = 3 * (size_t)triangle;
    return (1.0F - u - v) * vload2(corner, scene->uvs) + u * vload2(corner + 1, scene->uvs) +
           v * vload2(corner + 2, scene->uvs);
#else
    return (float2)(0.0F, 0.0F);
#endif
}
