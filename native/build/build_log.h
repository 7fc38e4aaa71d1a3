// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

namespace bvhlab {

/// A tree on its way to a better one.
struct BuildStep {
    std::uint32_t iteration;  ///< 0: the base tree
    double seconds;           ///< since the build began, the base tree included
    double cost;              ///< of the best tree so far: Eq. 2, one reference per leaf
};

/// What a builder that works in iterations did; empty for the others.
struct BuildLog {
    std::vector<BuildStep> steps;
    const char* ended = "";  ///< "converged", "iteration limit" or "time limit"; a string literal
};

}  // namespace bvhlab
