// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "build/builder.h"

namespace bvhlab {

/// Settings of build_ploc; the defaults are the paper's. The radius is `first_radius` in the first
/// iteration, where that is less than `radius`, and grows by `growth` from one to the next.
struct PlocConfig {
    int radius = 100;
    int first_radius = 512;
    double growth = 1.2;
};

inline constexpr std::array<ParameterInfo, 3> ploc_parameters{{
    {"radius", double(PlocConfig{}.radius), 1.0, 512.0, true, "clusters",
     "clusters on either side among which the nearest is searched",
     "Meister and Bittner 2022, section 4"},
    {"first_radius", double(PlocConfig{}.first_radius), 1.0, 512.0, true, "clusters",
     "radius of the first iteration, at most `radius`; 8 builds faster at nearly the same cost",
     "ours; the paper's radius is constant"},
    {"growth", PlocConfig{}.growth, 1.0, 512.0, false, "per iteration",
     "factor by which the radius grows from `first_radius` up to `radius`", "ours"},
}};

/// The settings in checked parameters (check_parameters).
PlocConfig ploc_config(const Parameters& parameters);

/// Parallel locally-ordered clustering (Meister and Bittner 2018a): bottom-up, from the triangles
/// along the Morton curve. In each iteration every cluster finds its nearest within a radius on the
/// curve, and clusters that are nearest to each other merge. Where a large row of clusters hardly
/// shrinks that way, neighbours on the curve merge as well (ploc.cpp).
///
/// The clustering does not depend on a cost model. Nodes are numbered depth-first; the tree is the
/// same for any thread count and instruction set. Throws Cancelled.
BinaryBvh build_ploc(const Mesh& mesh, const PlocConfig& config, Token& token);

}  // namespace bvhlab
