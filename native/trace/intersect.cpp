// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/intersect.h"

#include <algorithm>
#include <cmath>

#include "trace/expanded.h"
#include "trace/lattice.h"

namespace bvhlab {

bool decide_edges(const PreparedRay& ray, const float (&corners)[3][3], EdgeFunctions& edges) {
    constexpr int from[3] = {2, 0, 1}, to[3] = {1, 2, 0};
    double* const values[3] = {&edges.a, &edges.b, &edges.c};
    const double length = ray.given_direction[ray.kz];
    LatticeTriangle lattice;
    const bool fits = lattice.set(ray, corners);
    bool positive = std::max({edges.a, edges.b, edges.c}) > edges.bound;
    bool negative = std::min({edges.a, edges.b, edges.c}) < -edges.bound;
    Integer128 exact[3] = {};
    for (int i = 0; i < 3; ++i) {
        double& value = *values[i];
        if (std::abs(value) > edges.bound) continue;
        if (fits) {
            exact[i] = lattice.edge(from[i], to[i]);
            value = double(exact[i]) * lattice.edge_unit / length;
        } else {
            value = expanded_edge_function(ray, corners[from[i]], corners[to[i]]);
        }
        positive |= value > 0.0;
        negative |= value < 0.0;
        if (positive && negative) return false;
    }
    for (int i = 0; i < 3; ++i)
        if (!is_double(exact[i]))
            *values[i] = expanded_edge_function(ray, corners[from[i]], corners[to[i]]);
    return true;
}

bool exact_plane_crossing(const PreparedRay& ray, const float (&corners)[3][3],
                          PlaneCrossing& crossing) {
    LatticeTriangle lattice;
    if (lattice.set(ray, corners)) {
        const LatticeAnswer answer = lattice_plane_crossing(lattice, ray, crossing);
        if (answer != LatticeAnswer::unknown) return answer == LatticeAnswer::inside;
    }
    return expanded_plane_crossing(ray, corners, crossing);
}

}  // namespace bvhlab
