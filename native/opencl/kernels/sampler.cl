// SPDX-License-Identifier: GPL-3.0-or-later
// Random numbers of one sample of one pixel, as render/sampler.h has them: Owen-scrambled Sobol'
// pairs, shuffled and padded (Burley 2020, "Practical Hash-based Owen Scrambling").

typedef struct {
    uint pixel_seed, reversed_sample;
} Sampler;

// Which pair of dimensions serves what.
#define CAMERA_DIMENSION 0U
#define LENS_DIMENSION 1U
#define FIRST_BOUNCE_DIMENSION 2U
#define DIRECTION_PAIR 0U
#define CHOICE_PAIR 1U
#define FIRST_SHADOW_PAIR 2U
#define MOST_LAYERS 1024U

static uint bounce_dimension(uint bounce, uint shadow_rays) {
    return FIRST_BOUNCE_DIMENSION + bounce * (FIRST_SHADOW_PAIR + shadow_rays);
}

static uint layer_dimension(uint bounce, uint layer) {
    return 0x80000000U + bounce * MOST_LAYERS + layer;
}

/// Constants of C. Wellons' "lowbias32".
static uint hash_bits(uint x) {
    x ^= x >> 16;
    x *= 0x7FEB352DU;
    x ^= x >> 15;
    x *= 0x846CA68BU;
    x ^= x >> 16;
    return x;
}

static uint hash_with(uint seed, uint value) {
    return hash_bits(seed ^ hash_bits(value + 0x9E3779B9U));
}

static uint reverse_bits(uint x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00FF00FFU) << 8) | ((x & 0xFF00FF00U) >> 8);
    x = ((x & 0x0F0F0F0FU) << 4) | ((x & 0xF0F0F0F0U) >> 4);
    x = ((x & 0x33333333U) << 2) | ((x & 0xCCCCCCCCU) >> 2);
    return ((x & 0x55555555U) << 1) | ((x & 0xAAAAAAAAU) >> 1);
}

/// Laine & Karras 2011, with the constants of Burley 2020, section 3.
static uint scramble_reversed(uint x, uint seed) {
    x += seed;
    x ^= x * 0x6C50B47CU;
    x ^= x * 0xB82F1E52U;
    x ^= x * 0xC7AFE638U;
    x ^= x * 0x8D22F6E6U;
    return x;
}

static uint owen_scramble(uint x, uint seed) {
    return reverse_bits(scramble_reversed(reverse_bits(x), seed));
}

static uint sobol_butterflies(uint x) {
    x ^= (x << 1) & 0xAAAAAAAAU;
    x ^= (x << 2) & 0xCCCCCCCCU;
    x ^= (x << 4) & 0xF0F0F0F0U;
    x ^= (x << 8) & 0xFF00FF00U;
    x ^= (x << 16) & 0xFFFF0000U;
    return x;
}

static Sampler sampler_of(uint pixel, uint sample, uint seed) {
    return (Sampler){hash_with(hash_bits(seed), pixel), reverse_bits(sample)};
}

/// Two numbers in [0, 1), stratified together over the samples.
static double2 random_pair(Sampler random, uint dimension) {
    const uint seed = hash_with(random.pixel_seed, dimension);
    const uint first = scramble_reversed(random.reversed_sample, seed);
    const uint x = owen_scramble(first, hash_with(seed, 1U));
    const uint y = owen_scramble(sobol_butterflies(first), hash_with(seed, 2U));
    return (double2)((double)x * 0x1p-32, (double)y * 0x1p-32);
}
