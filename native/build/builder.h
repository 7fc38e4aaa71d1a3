// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/token.h"
#include "build/build_log.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"
#include "scene/mesh.h"

namespace bvhlab {

/// One parameter of a builder, as shown to users.
struct ParameterInfo {
    std::string_view name;
    double default_value, minimum, maximum;
    bool integer;  ///< only whole numbers are taken
    std::string_view unit;
    std::string_view description;
    std::string_view source;  ///< where the default comes from
};

/// Checked parameter values by name, every parameter of the builder present.
using Parameters = std::map<std::string, double, std::less<>>;

/// What a builder is called and how it is run.
struct BuilderInfo {
    std::string_view id;      ///< lower case, as in file names and on the command line
    std::string_view label;   ///< as in the paper
    std::string_view source;  ///< the publication it implements
    std::span<const ParameterInfo> parameters;
    BinaryBvh (*build)(const Mesh&, const CostModel&, const Parameters&, Token&, BuildLog&);
};

/// All builders, in the paper's order.
std::span<const BuilderInfo> builders();

/// Throws std::invalid_argument that lists the builders there are.
const BuilderInfo& find_builder(std::string_view id);

/// Fills in defaults. Throws std::invalid_argument naming an unknown or out-of-range parameter.
Parameters check_parameters(const BuilderInfo& builder, const Parameters& given);

}  // namespace bvhlab
