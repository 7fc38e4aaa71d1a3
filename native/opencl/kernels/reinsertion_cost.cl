// SPDX-License-Identifier: GPL-3.0-or-later
// Eq. 2 with one reference per leaf, in double, summed in the order of the host.

static double weighted_area(float area, uint child, double traversal, double intersection) {
    return (double)area * (is_leaf(child) ? intersection : traversal);
}

/// What each pair adds; pair 0, only its first side, the root.
kernel void weigh_pairs(global const SlotPair* pairs,           // the tree
                        uint count,                             // pairs
                        double traversal, double intersection,  // CostModel
                        global double* weights)                 // by pair
{
    const uint pair = get_global_id(0);
    if (pair >= count) return;
    const SlotPair sides = pairs[pair];
    const double left = weighted_area(sides.half_area.x, sides.child.x, traversal, intersection);
    const double right = weighted_area(sides.half_area.y, sides.child.y, traversal, intersection);
    weights[pair] = pair == 0 ? left : left + right;
}

/// Adds up each of the ranges that the host does, one after the other.
kernel void sum_ranges(global const double* weights,  // by pair
                       global const uint2* ranges,    // begin and end
                       uint count,                    // ranges
                       global const SlotPair* pairs,  // the tree
                       global double* sums)           // by range, then the root's weight and area
{
    const uint range = get_global_id(0);
    if (range == count) {
        sums[count] = weights[0];
        sums[count + 1] = (double)pairs[0].half_area.x;
    }
    if (range >= count) return;
    const uint2 indices = ranges[range];
    double sum = 0.0;
    for (uint i = indices.x; i < indices.y; ++i) sum += weights[i];
    sums[range] = sum;
}
