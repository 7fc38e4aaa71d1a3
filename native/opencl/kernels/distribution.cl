// SPDX-License-Identifier: GPL-3.0-or-later
// Choices in proportion to weights: render/distribution.h and render/light_odds.h.

#define WEIGHTS_PER_BLOCK 16

typedef struct {
    ulong index;
    double rest;  ///< where in the share of that index the random number fell, in [0, 1)
} WeightedChoice;

/// By `weights`, of which `sums` has the `sum_count` sums before each block and of all. A binary
/// search for the block, and a scan of it.
static WeightedChoice choose_by_weight(global const float* weights, global const double* sums,
                                       ulong sum_count, double random) {
    const double total = sums[sum_count - 1];
    const double target = least_d(random * total, next_below(total));
    ulong low = 0, high = sum_count;  // the first sum above target is in [low, high]
    while (low < high) {
        const ulong middle = (low + high) / 2;
        if (target < sums[middle])
            high = middle;
        else
            low = middle + 1;
    }
    double below = sums[low - 1];
    ulong index = (low - 1) * WEIGHTS_PER_BLOCK;
    while (below + (double)weights[index] <= target) below += (double)weights[index++];
    const double rest = (target - below) / (double)weights[index];
    return (WeightedChoice){index, clamp_d(rest, 0.0, 1.0 - 0x1p-53)};
}

static WeightedChoice choose_from(const Scene* scene, Distribution distribution, double random) {
    return choose_by_weight(scene->light_weights + distribution.first_weight,
                            scene->light_sums + distribution.first_sum, distribution.sums, random);
}

static double probability_in(const Scene* scene, Distribution distribution, ulong index) {
    return (double)scene->light_weights[distribution.first_weight + index] /
           scene->light_sums[distribution.first_sum + distribution.sums - 1];
}

// --- a few lights -------------------------------------------------------------------------------

/// Sums of the weights of ODDS_ENTRIES lights or groups of lights.
typedef struct {
    double sums[ODDS_ENTRIES + 1];
} LightOdds;

static bool no_odds(const LightOdds* odds) {
    return !(odds->sums[ODDS_ENTRIES] > 0.0);
}

static double odds_probability(const LightOdds* odds, uint entry) {
    return no_odds(odds) ? 0.0
                         : (odds->sums[entry + 1] - odds->sums[entry]) / odds->sums[ODDS_ENTRIES];
}

/// Requires !no_odds().
static WeightedChoice choose_by_odds(const LightOdds* odds, double random) {
    const double total = odds->sums[ODDS_ENTRIES];
    double target = random * total;
    if (!(target < total)) target = next_below(total);
    uint entry = 0;
    while (odds->sums[entry + 1] <= target) ++entry;
    const double rest = (target - odds->sums[entry]) / (odds->sums[entry + 1] - odds->sums[entry]);
    return (WeightedChoice){entry, clamp_d(rest, 0.0, 1.0 - 0x1p-53)};
}
