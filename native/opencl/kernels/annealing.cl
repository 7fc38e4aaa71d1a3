// SPDX-License-Identifier: GPL-3.0-or-later
// Simulated annealing (paper, section 2.2): a reinsertion chosen by chance, as
// build/annealing_choice.h.

// --- random numbers -----------------------------------------------------------------------------

/// The finaliser of SplitMix64 (Steele et al. 2014).
static ulong mix_bits(ulong value) {
    value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9UL;
    value = (value ^ (value >> 27)) * 0x94D049BB133111EBUL;
    return value ^ (value >> 31);
}

/// A sequence for each node and iteration.
static ulong random_state(ulong seed, ulong iteration, ulong slot) {
    return mix_bits(mix_bits(seed) ^ (iteration << 32) ^ slot);
}

/// Uniform in [0, 1), a multiple of 2^-24; Knuth's MMIX generator.
static float uniform_number(ulong* state) {
    *state = *state * 6364136223846793005UL + 1442695040888963407UL;
    return (float)(uint)(*state >> 40) * 0x1p-24F;
}

// --- choice -------------------------------------------------------------------------------------

/// What all searches of an iteration share; Heat of the host and heated_sparsity.
typedef struct {
    ulong seed, iteration;
    float temperature;        // > 0, in half areas of the unit scene
    float prune_probability;  // P_prune
    uint sparsity;            // one node in so many takes part
    uint unused;
} Heat;

typedef struct {
    Reinsertion accepted;
    float area;       // half, of the removed node
    float best_gain;  // so far, for pruning; not below staying where it is
    ulong random;
    float temperature, prune_probability;
} Choice;

#define CHOICE_PARAMETERS Heat heat,
#define CHOICE_ARGUMENTS heat

/// Returns whether the node takes part.
static bool start(Choice* choice, uint slot, Heat heat) {
    choice->accepted = (Reinsertion){0.0F, NO_TARGET, NO_TARGET};
    choice->best_gain = 0.0F;
    choice->random = random_state(heat.seed, heat.iteration, slot);
    choice->temperature = heat.temperature;
    choice->prune_probability = heat.prune_probability;
    return heat.sparsity <= 1 || uniform_number(&choice->random) * (float)heat.sparsity < 1.0F;
}

static void begin(Choice* choice, float area) {
    choice->area = area;
}

/// Eq. 4 for a loss >= 0 of half area, clamped to `most`. The exponential is rounded to float from
/// double, as the device's own for float may be some units off.
static bool happens(Choice* choice, float loss, float most) {
    const float chance = uniform_number(&choice->random);
    if (chance >= most) return false;
    const float exponent = divide(loss, choice->temperature);
    return chance < 1.0F - exponent || chance < (float)exp(-(double)exponent);
}

static void offer(Choice* choice, float gain, uint target, uint pivot) {
    choice->best_gain = choice->best_gain < gain ? gain : choice->best_gain;
    const float loss = choice->accepted.gain - gain;
    if (loss <= 0.0F || happens(choice, loss, 1.0F))
        choice->accepted = (Reinsertion){gain, target, pivot};
}

static bool ends(const Choice* choice, float gain) {
    return gain - choice->area <= choice->best_gain;
}

static bool hopes(Choice* choice, float gain, float area) {
    return !ends(choice, gain) ||
           happens(choice, choice->best_gain - (gain - choice->area), choice->prune_probability);
}

static Reinsertion proposal(const Choice* choice) {
    return choice->accepted;
}

// --- which pairs search -------------------------------------------------------------------------

/// Clears all proposals and lists the pairs of which a node takes part.
kernel void choose_pairs(uint count,                            // pairs
                         Heat heat,                             // of this iteration
                         global Reinsertion* proposals,         // by slot
                         global uint* searchers,                // gets the pairs
                         volatile global uint* searcher_count,  // how many
                         volatile local uint* shared)           // 2 words
{
    const uint pair = get_global_id(0);
    bool searches = false;
    if (pair < count) {
        const Reinsertion none = {0.0F, NO_TARGET, NO_TARGET};
        proposals[2 * pair] = none;
        proposals[2 * pair + 1] = none;
        Choice choice;
        if (pair > 0)
            searches = start(&choice, 2 * pair, heat) | start(&choice, 2 * pair + 1, heat);
    }
    append(searches, pair, searchers, searcher_count, shared);
}
