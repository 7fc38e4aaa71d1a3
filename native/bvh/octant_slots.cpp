// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/octant_slots.h"

#include <glm/geometric.hpp>
#include <limits>

namespace bvhlab {
namespace {

using Costs = std::array<std::array<double, 8>, 8>;  // [child][slot]

/// Twice the terms of the sum.
Costs slot_costs(std::span<const Box> boxes) {
    Box node = Box::empty();
    for (const Box& box : boxes) node.grow(box);
    const glm::dvec3 centre = glm::dvec3(node.lower) + glm::dvec3(node.upper);
    Costs costs{};
    for (std::size_t child = 0; child < boxes.size(); ++child) {
        const Box& box = boxes[child];
        const glm::dvec3 offset = glm::dvec3(box.lower) + glm::dvec3(box.upper) - centre;
        for (unsigned slot = 0; slot < 8; ++slot)
            costs[child][slot] = (slot & 4U ? -offset.x : offset.x) +
                                 (slot & 2U ? -offset.y : offset.y) +
                                 (slot & 1U ? -offset.z : offset.z);
    }
    return costs;
}

/// Gives the children a slot each, one child after the other, by the shortest path of changes that
/// lets the new one in (Kuhn 1955; in this form Jonker, Volgenant 1987). Prices keep all reduced
/// costs at 0 or above, and at 0 where a child has a slot.
class Assignment {
public:
    explicit Assignment(const Costs& costs) : costs_(costs) { child_in_.fill(none); }

    void add(unsigned child) {
        child_in_[entry] = child;
        unsigned last = entry;
        shortest_.fill(std::numeric_limits<double>::infinity());
        reached_.fill(false);
        do last = reach_next(last);
        while (child_in_[last] != none);
        for (; last != entry; last = before_[last]) child_in_[last] = child_in_[before_[last]];
    }

    std::array<std::uint8_t, 8> slots() const {
        std::array<std::uint8_t, 8> slots{};
        for (unsigned slot = 0; slot < 8; ++slot)
            if (child_in_[slot] != none) slots[child_in_[slot]] = std::uint8_t(slot);
        return slots;
    }

private:
    static constexpr unsigned none = 8;   // no child
    static constexpr unsigned entry = 8;  // not a slot: where a new child waits

    /// The nearest slot that no path has reached, one step of Dijkstra's algorithm behind `last`.
    unsigned reach_next(unsigned last) {
        reached_[last] = true;
        const unsigned child = child_in_[last];
        unsigned nearest = entry;
        double distance = std::numeric_limits<double>::infinity();
        for (unsigned slot = 0; slot < 8; ++slot) {
            if (reached_[slot]) continue;
            const double reduced = costs_[child][slot] - child_price_[child] - slot_price_[slot];
            if (reduced < shortest_[slot]) {
                shortest_[slot] = reduced;
                before_[slot] = last;
            }
            if (shortest_[slot] < distance) {
                distance = shortest_[slot];
                nearest = slot;
            }
        }
        for (unsigned slot = 0; slot <= entry; ++slot) {
            if (reached_[slot]) {
                child_price_[child_in_[slot]] += distance;
                slot_price_[slot] -= distance;
            } else {
                shortest_[slot] -= distance;
            }
        }
        return nearest;
    }

    const Costs& costs_;
    std::array<double, 8> child_price_{};
    std::array<double, 9> slot_price_{};
    std::array<unsigned, 9> child_in_;
    std::array<double, 9> shortest_;
    std::array<unsigned, 9> before_;
    std::array<bool, 9> reached_;
};

}  // namespace

std::array<std::uint8_t, 8> octant_slots(std::span<const Box> boxes) {
    const Costs costs = slot_costs(boxes);
    Assignment assignment(costs);
    for (unsigned child = 0; child < boxes.size(); ++child) assignment.add(child);
    return assignment.slots();
}

}  // namespace bvhlab
