// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "build/reinsertion_search.h"

namespace bvhlab {

/// Random numbers that depend only on where they are used, not on the thread or the order of calls.
/// A hash of seed, iteration and node (the finaliser of SplitMix64, Steele et al. 2014) begins a
/// linear congruential sequence (Knuth's MMIX constants), whose high bits are used, draw by draw.
class CounterRandom {
public:
    CounterRandom(std::uint64_t seed, std::uint64_t iteration, std::uint64_t node)
        : state_(mix(mix(seed) ^ (iteration << 32) ^ node)) {}

    /// Uniform in [0, 1), a multiple of 2^-24.
    float uniform() {
        state_ = state_ * 6364136223846793005U + 1442695040888963407U;
        return float(std::uint32_t(state_ >> 40)) * 0x1p-24F;
    }

private:
    static std::uint64_t mix(std::uint64_t value) {
        value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9U;
        value = (value ^ (value >> 27)) * 0x94D049BB133111EBU;
        return value ^ (value >> 31);
    }

    std::uint64_t state_;
};

/// What all searches of one heated iteration share.
struct Heat {
    float temperature;        ///< > 0, in half areas of the unit scene
    float prune_probability;  ///< P_prune
    std::uint64_t seed, iteration;
};

/// A reinsertion chosen by chance: simulated annealing at a positive temperature (paper, section
/// 2.2). Positions are accepted one after the other as the search comes to them, each against the
/// one accepted last, the first against staying; the last one accepted is proposed. Subtrees that
/// cannot beat the best gain seen are entered all the same now and then.
class AnnealedReinsertion {
public:
    AnnealedReinsertion(const Heat& heat, std::uint32_t slot)
        : heat_(heat), random_(heat.seed, heat.iteration, slot) {}

    Reinsertion accepted;

    /// True for a random one in `sparsity` nodes.
    bool takes_part(std::uint32_t sparsity) {
        return sparsity <= 1 || random_.uniform() * float(sparsity) < 1.0F;
    }

    void begin(float area) { area_ = area; }

    void offer(float gain, std::uint32_t target, std::uint32_t pivot) {
        best_gain_ = std::max(best_gain_, gain);
        const float loss = accepted.gain - gain;
        if (loss <= 0.0F || happens(loss, 1.0F)) accepted = {gain, target, pivot};
    }

    bool hopes(float gain, float) {
        return !ends(gain) || happens(best_gain_ - (gain - area_), heat_.prune_probability);
    }

    bool ends(float gain) const { return gain - area_ <= best_gain_; }

private:
    /// Eq. 4 for a loss >= 0 of half area, clamped to `most`. It may not be 1 for a loss of 0, or
    /// searches among many equal boxes would visit them all.
    bool happens(float loss, float most) {
        const float chance = random_.uniform();
        if (chance >= most) return false;
        const float exponent = loss / heat_.temperature;
        return chance < 1.0F - exponent || chance < std::exp(-exponent);  // exp(-x) >= 1 - x
    }

    const Heat& heat_;
    CounterRandom random_;
    float area_ = 0.0F;
    float best_gain_ = 0.0F;  // so far, for pruning; not below staying where it is
};

}  // namespace bvhlab
