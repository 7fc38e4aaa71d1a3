// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "build/reinsertion_tree.h"

namespace bvhlab {

/// The reinsertion that a search proposes for one node: its subtree is removed, its sibling takes
/// the parent's place, and the parent is put back above the target with target and subtree as
/// children.
struct Reinsertion {
    static constexpr std::uint32_t none = 0;  ///< no target. The root, slot 0, is never one

    float gain = 0.0F;            ///< decrease of the sum of half areas, in units of the unit scene
    std::uint32_t target = none;  ///< slot
    /// The last slot on the way up from the node before the way down to the target begins; the
    /// target itself where it is an ancestor of the node.
    std::uint32_t pivot = none;
};

/// Searches for new positions of nodes (Meister and Bittner 2018b, section 3.1): from the node
/// upwards to the root, at each level down into the sibling's subtree where a choice has hopes of
/// it. The tree is not changed, so that all nodes can search at once. One object per thread.
///
/// Two siblings go upwards together: both meet the same nodes. Each has a Choice, which is asked to
/// - `begin(area)`: half the surface area of the node;
/// - `offer(gain, target, pivot)`: a position (see Reinsertion), which it may keep. All positions
///   in the nodes entered, but ancestors no better than one offered before;
/// - `hopes(gain, area)`: is a subtree worth entering? `gain` is the area saved up to there, its
///   root grown around the removed node: a position inside gains at most `gain` less the area of
///   the removed node. `area` is the root's half area;
/// - `ends(gain)`: is no subtree with at most this `gain` worth it any more?
///
/// A search ends with what it found after `most_visits` pairs. In ordinary trees it visits some 50;
/// where thousands of boxes overlap nothing can be pruned, and searches of all nodes would take
/// quadratic time.
class ReinsertionSearch {
public:
    static constexpr std::uint64_t most_visits = 4096;

    explicit ReinsertionSearch(const ReinsertionTree& tree) : tree_(tree) {}

    /// For the nodes of `pair`, not the root's, that are `searching`.
    template <class Choice>
    void run(std::uint32_t pair, std::array<Choice, 2>& choices, std::array<bool, 2> searching) {
        last_visit_ = visits_ + most_visits;
        const SlotPair& family = tree_.pairs[pair];
        const BoxPair boxes = family.boxes();
        for (const std::uint32_t side : {0U, 1U}) {
            if (!searching[side]) continue;
            choices[side].begin(family.half_area[side]);
            // Below the sibling: entering it makes it as large as the parent, whose area is saved.
            enter(family, 1 - side, family.half_area[1 - side], boxes, side, 2 * pair + side,
                  choices[side]);
        }

        // Upwards: `rest` is the pivot's box without the one node and the other, `gains` the area
        // saved so far. Once a node is known to touch no face of the pivot's box, no box above
        // would shrink without it.
        std::uint32_t pivot = tree_.parents[pair];
        BoxPair rest = swap_sides(boxes);
        const float saved = tree_.half_area(pivot);
        float gains[2] = {saved, saved};
        std::array<bool, 2> shrinks = searching;
        while (pivot != ReinsertionTree::root) {
            ++visits_;
            const SlotPair& level = tree_.pairs[pivot / 2];
            const std::uint32_t other = 1 - pivot % 2;
            const BoxPair other_box = repeat(level.boxes(), other);
            const Floats united = half_areas(unite(boxes, other_box));
            for (const std::uint32_t side : {0U, 1U}) {
                if (!searching[side]) continue;
                choices[side].offer(gains[side] - united[int(side)], tree_.sibling(pivot), pivot);
                enter(level, other, gains[side] + (level.half_area[other] - united[int(side)]),
                      boxes, side, pivot, choices[side]);
                searching[side] = shrinks[side] || !choices[side].ends(gains[side]);
            }
            if ((!searching[0] && !searching[1]) || visits_ >= last_visit_) return;
            pivot = tree_.parent(pivot);
            if (!shrinks[0] && !shrinks[1]) continue;
            rest = unite(rest, other_box);
            shrink(pivot, rest, gains, shrinks, choices);
        }
    }

    std::uint64_t visits() const { return visits_; }  ///< pairs looked at by all runs

private:
    struct Subtree {
        std::uint32_t pair;
        float gain;
    };

    /// Takes the pivot as a target, and adds what it shrinks by to the gains.
    template <class Choice>
    void shrink(std::uint32_t pivot, const BoxPair& rest, float (&gains)[2],
                std::array<bool, 2>& shrinks, std::array<Choice, 2>& choices) {
        const SlotPair& level = tree_.pairs[pivot / 2];
        const float area = level.half_area[pivot % 2];
        const Floats rest_areas = half_areas(rest);
        const std::array<bool, 2> smaller = differ(rest, repeat(level.boxes(), pivot % 2));
        for (const std::uint32_t side : {0U, 1U}) {
            if (!shrinks[side]) continue;
            const float rest_area = rest_areas[int(side)];
            // The new parent gets the pivot's old box, the pivot the smaller one.
            if (pivot != ReinsertionTree::root)
                choices[side].offer(gains[side] - rest_area, pivot, pivot);
            gains[side] += area - rest_area;
            shrinks[side] = smaller[side];
        }
    }

    /// Visits the nodes below the one on `side` of `pair`, if there is hope.
    template <class Choice>
    void enter(const SlotPair& pair, std::uint32_t side, float gain, const BoxPair& boxes,
               std::uint32_t removed_side, std::uint32_t pivot, Choice& choice) {
        if (!tree_.is_leaf(pair.child[side]) && choice.hopes(gain, pair.half_area[side]))
            descend({pair.child[side], gain}, repeat(boxes, removed_side), pivot, choice);
    }

    /// Visits the nodes below a node, the more promising child first.
    template <class Choice>
    void descend(Subtree subtree, const BoxPair& removed, std::uint32_t pivot, Choice& choice) {
        for (;;) {
            ++visits_;
            const SlotPair& pair = tree_.pairs[subtree.pair];
            const Floats united = half_areas(unite(pair.boxes(), removed));
            const float areas[2] = {united[0], united[1]};
            const float gains[2] = {subtree.gain + (pair.half_area[0] - areas[0]),
                                    subtree.gain + (pair.half_area[1] - areas[1])};
            const std::uint32_t slot = 2 * subtree.pair;
            choice.offer(subtree.gain - areas[0], slot, pivot);
            choice.offer(subtree.gain - areas[1], slot + 1, pivot);

            const std::uint32_t first = gains[1] > gains[0] ? 1 : 0, second = 1 - first;
            const auto hopes = [&](std::uint32_t side) {
                return !tree_.is_leaf(pair.child[side]) &&
                       choice.hopes(gains[side], pair.half_area[side]);
            };
            if (hopes(second)) pending_.push_back({pair.child[second], gains[second]});
            if (hopes(first) && visits_ < last_visit_) {
                subtree = {pair.child[first], gains[first]};
                continue;
            }
            do {
                if (visits_ >= last_visit_) pending_.clear();
                if (pending_.empty()) return;
                subtree = pending_.back();
                pending_.pop_back();
            } while (choice.ends(subtree.gain));
        }
    }

    const ReinsertionTree& tree_;
    std::vector<Subtree> pending_;  // empty between descents
    std::uint64_t visits_ = 0, last_visit_ = 0;
};

/// The best reinsertion: hill climbing.
struct BestReinsertion {
    Reinsertion best;

    void begin(float area) { area_ = area; }

    void offer(float gain, std::uint32_t target, std::uint32_t pivot) {
        if (gain > best.gain) best = {gain, target, pivot};
    }

    /// The second condition loses nothing: a position inside a node that is not larger than the
    /// removed one is no better than the position above that node. It is checked on its own since
    /// it is what makes aggressive locks safe (reinsertion_moves.h), whatever the rounding of
    /// gains.
    bool hopes(float gain, float area) const { return !ends(gain) && area > area_; }

    bool ends(float gain) const { return gain - area_ <= best.gain; }

private:
    float area_ = 0.0F;
};

}  // namespace bvhlab
