// SPDX-License-Identifier: GPL-3.0-or-later
// Textures as scene/texture.h looks them up: bilinear between texel centres, and the values that
// materials take from them (render/material_input.h).

#define WRAP_REPEAT 0U
#define WRAP_EXTEND 1U
#define WRAP_CLIP 2U
#define WRAP_MIRROR 3U

// --- textures -----------------------------------------------------------------------------------

#if defined(TEXTURES) || defined(ENVIRONMENT)

/// Linear value of an sRGB byte, or straight between those of two.
static float decode_byte(const Scene* scene, float encoded) {
    const int below = clamp((int)encoded, 0, 255);
    const float low = scene->decoded[below];
    return low + (encoded - (float)below) * (scene->decoded[below + 1] - low);
}

static float opaque(const Texture* texture) {
    return texture->has_bytes ? 255.0F : 1.0F;
}

/// Values of one texel, RGBA: bytes as they are, floats linear.
static float4 texel(const Scene* scene, const Texture* texture, int x, int y) {
    const ulong first = texture->first + ((ulong)y * texture->width + (ulong)x) * texture->channels;
    const float full = opaque(texture);
    float4 value = (float4)(full, full, full, full);
    if (texture->has_bytes) {
        global const uchar* bytes = scene->texture_bytes + first;
        value.x = (float)bytes[0];
        if (texture->channels >= 3) value.yz = (float2)((float)bytes[1], (float)bytes[2]);
        if (texture->channels == 4) value.w = (float)bytes[3];
    } else {
        global const float* floats = scene->texture_floats + first;
        value.x = floats[0];
        if (texture->channels >= 3) value.yz = (float2)(floats[1], floats[2]);
        if (texture->channels == 4) value.w = floats[3];
    }
    if (texture->channels == 1) value.yz = value.xx;
    return value;
}

static float4 linear(const Scene* scene, const Texture* texture, float4 value) {
    if (!texture->has_bytes) return value;
    if (!texture->srgb) return value * (1.0F / 255.0F);
    return (float4)(decode_byte(scene, value.x), decode_byte(scene, value.y),
                    decode_byte(scene, value.z), value.w * (1.0F / 255.0F));
}

/// A coordinate brought to [0, 1], or for WRAP_CLIP to [-1, 2].
static float wrapped(float coordinate, uint wrap) {
    const float limit = 1e9F;
    const float bounded = coordinate > -limit ? least_f(coordinate, limit) : -limit;
    if (wrap == WRAP_REPEAT) return bounded - floor(bounded);
    if (wrap == WRAP_EXTEND) return clamp_f(bounded, 0.0F, 1.0F);
    if (wrap == WRAP_CLIP) return clamp_f(bounded, -1.0F, 2.0F);
    const float in_period = bounded - 2.0F * floor(0.5F * bounded);
    return in_period > 1.0F ? 2.0F - in_period : in_period;
}

/// The texel in this row or column, which may lie just outside; -1: none.
static int index_of(float place, uint size, uint wrap) {
    const int index = (int)place, last = (int)size - 1;
    if (index >= 0 && index <= last) return index;
    if (wrap == WRAP_CLIP) return -1;
    if (wrap == WRAP_REPEAT) return index < 0 ? last : 0;
    return index < 0 ? 0 : last;
}

/// The texel with its colour times alpha.
static float4 texel_or_empty(const Scene* scene, const Texture* texture, int x, int y) {
    if (x < 0 || y < 0) return (float4)(0.0F, 0.0F, 0.0F, 0.0F);
    const float4 value = texel(scene, texture, x, y);
    if (value.w == opaque(texture)) return value;
    return (float4)(value.xyz * divide(value.w, opaque(texture)), value.w);
}

static float4 without_alpha(const Texture* texture, float4 value) {
    if (texture->channels < 4 || value.w == opaque(texture) || !(value.w > 0.0F)) return value;
    return (float4)(value.xyz * divide(opaque(texture), value.w), value.w);
}

static float4 mix_4(float4 x, float4 y, float a) {
    return x * (1.0F - a) + y * a;
}

/// Linear RGBA at `uv`.
CALLED float4 look_up(const Scene* scene, uint index, float2 uv) {
    const Texture texture = scene->textures[index];
    const float x = wrapped(uv.x, texture.wrap) * (float)texture.width;
    const float y = (1.0F - wrapped(uv.y, texture.wrap)) * (float)texture.height;
    const bool closest = texture.closest != 0;
    const float left = floor(closest ? x : x - 0.5F), upper = floor(closest ? y : y - 0.5F);
    const int x0 = index_of(left, texture.width, texture.wrap);
    const int y0 = index_of(upper, texture.height, texture.wrap);
    float4 value = texel_or_empty(scene, &texture, x0, y0);
    if (!closest) {
        const int x1 = index_of(left + 1.0F, texture.width, texture.wrap);
        const int y1 = index_of(upper + 1.0F, texture.height, texture.wrap);
        const float across = x - 0.5F - left, down = y - 0.5F - upper;
        const float4 above = mix_4(value, texel_or_empty(scene, &texture, x1, y0), across);
        const float4 below = mix_4(texel_or_empty(scene, &texture, x0, y1),
                                   texel_or_empty(scene, &texture, x1, y1), across);
        value = mix_4(above, below, down);
    }
    return linear(scene, &texture, without_alpha(&texture, value));
}

#endif

// --- inputs of materials ------------------------------------------------------------------------

#ifdef TEXTURES

/// The value at the texture coordinates `uv` of a surface, not clamped.
static float3 looked_up(const Scene* scene, uint index, float2 uv) {
    const Lookup lookup = scene->lookups[index];
    const float* m = lookup.mapping;
    const float2 place =
        (float2)(m[0] * uv.x + m[2] * uv.y + m[4] * 1.0F, m[1] * uv.x + m[3] * uv.y + m[5] * 1.0F);
    const float4 texel = look_up(scene, lookup.texture, place);
    float3 value = texel.xyz;
    if (lookup.channel == 1) value = texel.xxx;
    if (lookup.channel == 2) value = texel.yyy;
    if (lookup.channel == 3) value = texel.zzz;
    if (lookup.channel == 4) value = texel.www;
    if (lookup.channel == 5) value = all_f((float)luminance(texel.xyz));
    return vload3(0, lookup.offset) + vload3(0, lookup.scale) * value;
}

/// In [0, most]; 0 for NaN.
static float clamped(float value, float most) {
    return value > 0.0F ? least_f(value, most) : 0.0F;
}

#endif

/// The value of a number in [0, 1].
static float number_at(const Scene* scene, NumberInput input, float2 uv) {
#ifdef TEXTURES
    if (input.lookup != NO_LOOKUP) return clamped(looked_up(scene, input.lookup, uv).x, 1.0F);
#endif
    return input.value;
}

/// The value of a colour, each channel in [0, most].
static float3 color_at(const Scene* scene, ColorInput input, float2 uv, float most) {
#ifdef TEXTURES
    if (input.lookup != NO_LOOKUP) {
        const float3 value = looked_up(scene, input.lookup, uv);
        return (float3)(clamped(value.x, most), clamped(value.y, most), clamped(value.z, most));
    }
#endif
    return (float3)(input.value[0], input.value[1], input.value[2]);
}
