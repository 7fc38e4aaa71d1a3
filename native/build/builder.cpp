// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/builder.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "build/lbvh.h"
#include "build/sah.h"
#include "build/sbvh.h"

namespace bvhlab {
namespace {

const BuilderInfo all_builders[] = {
    {"lbvh",
     "LBVH",
     "Karras 2012, 60-bit Morton codes",
     {},
     [](const Mesh& mesh, const CostModel&, const Parameters&, Token& token, BuildLog&) {
         return build_lbvh(mesh, token);
     }},
    {"sah",
     "SAH",
     "full sweep, top-down; Wald 2007",
     {},
     [](const Mesh& mesh, const CostModel& model, const Parameters&, Token& token, BuildLog&) {
         return build_sah(mesh, model, token);
     }},
    {"sbvh", "SBVH", "spatial splits; Stich, Friedrich, Dietrich 2009", sbvh_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog&) { return build_sbvh(mesh, model, sbvh_config(given), token); }},
};

std::string number_text(double value) {
    std::string text = std::to_string(value);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
    return text;
}

void check_value(const BuilderInfo& builder, const ParameterInfo& info, double value) {
    const bool whole = !info.integer || value == std::floor(value);
    if (whole && value >= info.minimum && value <= info.maximum) return;
    throw std::invalid_argument("parameter '" + std::string(info.name) + "' of builder '" +
                                std::string(builder.id) + "' must be " +
                                (info.integer ? "a whole number " : "") + "from " +
                                number_text(info.minimum) + " to " + number_text(info.maximum) +
                                ", not " + number_text(value));
}

}  // namespace

std::span<const BuilderInfo> builders() {
    return all_builders;
}

const BuilderInfo& find_builder(std::string_view id) {
    std::string known;
    for (const BuilderInfo& builder : all_builders) {
        if (builder.id == id) return builder;
        known += (known.empty() ? "" : ", ") + std::string(builder.id);
    }
    throw std::invalid_argument("unknown builder '" + std::string(id) + "'; there are " + known);
}

Parameters check_parameters(const BuilderInfo& builder, const Parameters& given) {
    Parameters checked;
    for (const ParameterInfo& info : builder.parameters)
        checked.emplace(info.name, info.default_value);
    for (const auto& [name, value] : given) {
        const auto info = std::ranges::find(builder.parameters, name, &ParameterInfo::name);
        if (info == builder.parameters.end())
            throw std::invalid_argument("builder '" + std::string(builder.id) +
                                        "' has no parameter '" + name + "'");
        check_value(builder, *info, value);
        checked[name] = value;
    }
    return checked;
}

}  // namespace bvhlab
