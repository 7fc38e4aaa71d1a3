// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/builder.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "build/atrbvh.h"
#include "build/hlbvh.h"
#include "build/hybrid.h"
#include "build/lbvh.h"
#include "build/ploc.h"
#include "build/prbvh.h"
#include "build/prbvh_a.h"
#include "build/sah.h"
#include "build/sbvh.h"
#include "build/trbvh.h"

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
    {"hlbvh", "HLBVH", "binned SAH above LBVH clusters; Pantaleoni and Luebke 2010",
     hlbvh_parameters,
     [](const Mesh& mesh, const CostModel&, const Parameters& given, Token& token, BuildLog&) {
         return build_hlbvh(mesh, hlbvh_config(given), token);
     }},
    {"ploc", "PLOC", "parallel locally-ordered clustering; Meister and Bittner 2018",
     ploc_parameters,
     [](const Mesh& mesh, const CostModel&, const Parameters& given, Token& token, BuildLog&) {
         return build_ploc(mesh, ploc_config(given), token);
     }},
    {"atrbvh", "ATRBVH", "agglomerative treelet restructuring; Domingues, Pedrini 2015",
     atrbvh_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) { return build_atrbvh(mesh, model, atrbvh_config(given), token, log); }},
    {"prbvh", "PRBVH", "parallel reinsertion; Meister and Bittner 2018", prbvh_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) { return build_prbvh(mesh, model, prbvh_config(given), token, log); }},
    {"prbvh_a", "PRBVHᴬ", "parallel reinsertion, simulated annealing; Meister and Bittner 2022",
     prbvh_a_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) { return build_prbvh_a(mesh, model, annealing_config(given), token, log); }},
    {"prbvh_s", "PRBVHₛ", "parallel reinsertion of an SBVH; Meister and Bittner 2022",
     prbvh_s_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) {
         return build_prbvh_s(mesh, model, sbvh_config(given), prbvh_config(given), token, log);
     }},
    {"prbvh_sa", "PRBVHₛᴬ",
     "parallel reinsertion of an SBVH, simulated annealing; Meister and Bittner 2022",
     prbvh_sa_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) {
         return build_prbvh_sa(mesh, model, sbvh_config(given), annealing_config(given), token,
                               log);
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
    {"trbvh", "TRBVH", "optimal treelets; Karras, Aila 2013", trbvh_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) { return build_trbvh(mesh, model, trbvh_config(given), token, log); }},
    {"hybrid", "Hybrid", "SBVH, reinsertion of the nodes above the collapsed leaves; ours",
     hybrid_parameters,
     [](const Mesh& mesh, const CostModel& model, const Parameters& given, Token& token,
        BuildLog& log) {
         return build_hybrid(mesh, model, sbvh_config(given), prbvh_config(given), token, log);
     }},
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
