// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "build/builder.h"

namespace bvhlab {

/// Settings of build_sbvh; the defaults are the paper's. Each is a parameter of the builder of the
/// same name.
struct SbvhConfig {
    double alpha = 1e-5;
    int spatial_bins = 128;
    int max_spatial_depth = 48;
    int max_leaf_size = 8;
    double max_references = 8.0;
};

inline constexpr std::array<ParameterInfo, 5> sbvh_parameters{{
    {"alpha", SbvhConfig{}.alpha, 0.0, 1.0, false, "share of the scene's surface area",
     "least overlap of an object split's children that makes a spatial split worth a try",
     "Stich et al. 2009, section 4.5"},
    {"spatial_bins", double(SbvhConfig{}.spatial_bins), 2.0, 256.0, true, "bins per axis",
     "planes tried per axis, plus one", "Meister and Bittner 2022, section 4"},
    {"max_spatial_depth", double(SbvhConfig{}.max_spatial_depth), 0.0, 64.0, true, "levels",
     "depth from which on only object splits are made; 0 gives the SAH builder's tree",
     "Aila and Laine 2009, released builder"},
    {"max_leaf_size", double(SbvhConfig{}.max_leaf_size), 1.0, 64.0, true, "references",
     "spatial splits end at nodes of at most this size that are cheapest as a leaf; "
     "1 splits on down to single references",
     "Aila and Laine 2009, released builder"},
    {"max_references", SbvhConfig{}.max_references, 1.0, 0x1p31, false, "references per triangle",
     "limit on duplicates, which bounds the memory; subtrees share it by their size; "
     "1: no duplicates, 2^31: no limit",
     "ours; the paper has no limit"},
}};

/// The settings in checked parameters (check_parameters).
SbvhConfig sbvh_config(const Parameters& parameters);

/// Duplicates that the tree of a mesh of so many triangles may hold: at most most_references are
/// left in all.
std::size_t duplicate_budget(std::size_t triangles, double max_references);

/// Spatial splits in BVHs (Stich, Friedrich, Dietrich 2009): as build_sah, but where the children
/// of a node would overlap, references may be cut at a plane and go to both children, if that costs
/// less.
///
/// Every triangle stays referenced. Boxes of parts are padded so that no hit falls between them
/// (clip.h). Nodes are numbered depth-first; the tree is the same for any thread count. Throws
/// Cancelled.
BinaryBvh build_sbvh(const Mesh& mesh, const CostModel& model, const SbvhConfig& config,
                     Token& token);

}  // namespace bvhlab
