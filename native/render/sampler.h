// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>

namespace bvhlab {

/// Mixes all bits of x; a bijection (xorshift and multiply, constants of C. Wellons' "lowbias32").
constexpr std::uint32_t hash_bits(std::uint32_t x) {
    x ^= x >> 16;
    x *= 0x7FEB352DU;
    x ^= x >> 15;
    x *= 0x846CA68BU;
    x ^= x >> 16;
    return x;
}

constexpr std::uint32_t hash_bits(std::uint32_t seed, std::uint32_t value) {
    return hash_bits(seed ^ hash_bits(value + 0x9E3779B9U));
}

constexpr std::uint32_t reverse_bits(std::uint32_t x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00FF00FFU) << 8) | ((x & 0xFF00FF00U) >> 8);
    x = ((x & 0x0F0F0F0FU) << 4) | ((x & 0xF0F0F0F0U) >> 4);
    x = ((x & 0x33333333U) << 2) | ((x & 0xCCCCCCCCU) >> 2);
    return ((x & 0x55555555U) << 1) | ((x & 0xAAAAAAAAU) >> 1);
}

/// Owen scrambling of a 32-bit fraction whose bits are reversed: each bit is flipped depending on
/// the bits below it only, which before reversal are above it. Laine & Karras 2011 do it as a hash
/// in which bits only affect higher ones; constants of Burley 2020, "Practical Hash-based Owen
/// Scrambling", section 3.
constexpr std::uint32_t scramble_reversed(std::uint32_t x, std::uint32_t seed) {
    x += seed;
    x ^= x * 0x6C50B47CU;
    x ^= x * 0xB82F1E52U;
    x ^= x * 0xC7AFE638U;
    x ^= x * 0x8D22F6E6U;
    return x;
}

constexpr std::uint32_t owen_scramble(std::uint32_t x, std::uint32_t seed) {
    return reverse_bits(scramble_reversed(reverse_bits(x), seed));
}

/// First dimension of the Sobol' sequence: the radical inverse in base 2.
constexpr std::uint32_t sobol_first(std::uint32_t index) {
    return reverse_bits(index);
}

/// Second dimension from the first. Its generator matrix is Pascal's triangle modulo 2, the fifth
/// Kronecker power of [[1, 1], [0, 1]], so five butterflies apply it.
constexpr std::uint32_t sobol_butterflies(std::uint32_t x) {
    x ^= (x << 1) & 0xAAAAAAAAU;
    x ^= (x << 2) & 0xCCCCCCCCU;
    x ^= (x << 4) & 0xF0F0F0F0U;
    x ^= (x << 8) & 0xFF00FF00U;
    x ^= (x << 16) & 0xFFFF0000U;
    return x;
}

constexpr std::uint32_t sobol_second(std::uint32_t index) {
    return sobol_butterflies(sobol_first(index));
}

/// Random numbers of one sample of one pixel. They depend on (pixel, sample, dimension, seed) only.
///
/// Each pair of dimensions is a (0, 2)-sequence over the samples of a pixel, Owen-scrambled and
/// shuffled so that pairs and pixels are independent ("padding", Burley 2020, section 4).
class Sampler {
public:
    Sampler(std::uint32_t pixel, std::uint32_t sample, std::uint32_t seed)
        : pixel_seed_(hash_bits(hash_bits(seed), pixel)), reversed_sample_(reverse_bits(sample)) {}

    /// Two numbers in [0, 1), stratified together over the samples.
    glm::dvec2 pair(std::uint32_t dimension) const {
        const std::uint32_t seed = hash_bits(pixel_seed_, dimension);
        // Scrambling an index permutes aligned blocks of 2^k samples, each of which is a net. The
        // index is only needed reversed, which is the first Sobol' dimension.
        const std::uint32_t first = scramble_reversed(reversed_sample_, seed);
        const std::uint32_t x = owen_scramble(first, hash_bits(seed, 1));
        const std::uint32_t y = owen_scramble(sobol_butterflies(first), hash_bits(seed, 2));
        return {x * 0x1p-32, y * 0x1p-32};
    }

private:
    std::uint32_t pixel_seed_, reversed_sample_;
};

/// Which pair of dimensions serves what, so that no two uses share one. A path at bounce b (0:
/// where the camera ray hits) takes the pairs from bounce_dimension(b, shadow_rays) on.
enum Dimension : std::uint32_t {
    camera_dimension = 0,
    lens_dimension = 1,
    first_bounce_dimension = 2
};

/// What a bounce takes, in this order; the pairs of its shadow rays follow.
enum BounceDimension : std::uint32_t { direction_pair, choice_pair, first_shadow_pair };

inline constexpr std::uint32_t most_depth = 1024;      ///< bounces
inline constexpr std::uint32_t most_shadow_rays = 64;  ///< at a hit
inline constexpr std::uint32_t most_layers = 1024;     ///< passed straight through between bounces

constexpr std::uint32_t bounce_dimension(std::uint32_t bounce, std::uint32_t shadow_rays) {
    return first_bounce_dimension + bounce * (first_shadow_pair + shadow_rays);
}

/// Decides whether a path passes straight through its `layer`-th surface after a bounce.
constexpr std::uint32_t layer_dimension(std::uint32_t bounce, std::uint32_t layer) {
    return 0x80000000U + bounce * most_layers + layer;
}

static_assert(bounce_dimension(most_depth + 1, most_shadow_rays) < layer_dimension(0, 0));

}  // namespace bvhlab
