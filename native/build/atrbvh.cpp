// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/atrbvh.h"

#include <cmath>

#include "build/agglomeration.h"
#include "build/lbvh.h"
#include "bvh/depth_first.h"

namespace bvhlab {
namespace {

/// A power of two that brings a box's longest side to 1..2; 1 for a point. Exact, so that the
/// clustering of a scene does not depend on its scale.
double unit_scale(const Box& box) {
    double longest = 0.0;
    for (int axis = 0; axis < 3; ++axis)
        longest = std::max(longest, double(box.upper[axis]) - double(box.lower[axis]));
    return longest > 0.0 ? std::ldexp(1.0, -std::ilogb(longest)) : 1.0;
}

/// The treelet's leaves in units of its root: areas fit into float.
void load_leaves(const BinaryBvh& bvh, const Treelet& treelet, BoxRows& rows) {
    const double scale = unit_scale(bvh.boxes[treelet.interior[0]]);
    for (unsigned i = 0; i < treelet.size; ++i) {
        const Box& box = bvh.boxes[treelet.leaves[i]];
        for (int axis = 0; axis < 3; ++axis) {
            rows.lower[axis][i] = float(double(box.lower[axis]) * scale);
            rows.upper[axis][i] = float(double(box.upper[axis]) * scale);
        }
    }
}

}  // namespace

AtrbvhConfig atrbvh_config(const Parameters& parameters) {
    const auto value = [&](std::string_view name) { return parameters.find(name)->second; };
    return {.treelet_size = int(value("treelet_size")),
            .iterations = int(value("iterations")),
            .max_seconds = value("max_seconds")};
}

BinaryBvh build_atrbvh(const Mesh& mesh, const CostModel& model, const AtrbvhConfig& config,
                       Token& token, BuildLog& log) {
    token.begin("building ATRBVH");
    const Stopwatch watch;
    Token base_token(&token);
    BinaryBvh bvh = build_lbvh(mesh, base_token);
    Array<std::uint32_t> counts = reference_counts(bvh, token);

    // Accept a treelet only if it costs less. What is below its leaves costs the same
    // either way, and so do the leaves and the root: the interior nodes between decide.
    const auto restructure = [&](std::uint32_t root) {
        const Treelet treelet = form_treelet(bvh, root, unsigned(config.treelet_size));
        BoxRows rows;
        load_leaves(bvh, treelet, rows);
        Topology topology;
        agglomerate(rows, int(treelet.size), topology.merges.data());
        measure(bvh, treelet, topology);
        if (!(topology.area < treelet.area)) return 0.0;
        replace(bvh, counts, treelet, topology);
        return treelet.area - topology.area;
    };
    const RestructuringLimits limits{.treelet_size = std::uint32_t(config.treelet_size),
                                     .iterations = std::uint32_t(config.iterations),
                                     .max_seconds = config.max_seconds};
    restructure_treelets(bvh, counts, limits, model, watch, token, log, restructure);
    return depth_first(bvh, token);
}

}  // namespace bvhlab
