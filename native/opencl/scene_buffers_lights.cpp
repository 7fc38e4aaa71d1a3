// SPDX-License-Identifier: GPL-3.0-or-later
#include <span>
#include <vector>

#include "opencl/scene_buffers.h"

namespace bvhlab {

/// Reads what light sampling has prepared: devices compute with the very same numbers.
struct LightParts {
    using Lamps = LightSampler::Lamps;

    static const Lamps& lamps(const LightSampler& lights) { return lights.lamps_; }
    static const Lamps& suns(const LightSampler& lights) { return lights.suns_; }
    static const auto& emitters(const LightSampler& lights) { return lights.emitters_; }
    static const auto& environment(const LightSampler& lights) { return lights.environment_; }
    static const auto& extended(const LightSampler& lights) { return lights.extended_; }
    static double world_brightness(const LightSampler& lights) { return lights.world_brightness_; }
    static bool compared(const LightSampler& lights) { return lights.compared_; }
    static std::size_t emitters_entry(const LightSampler& lights) { return lights.emitters_entry_; }
    static std::size_t world_entry(const LightSampler& lights) { return lights.world_entry_; }
    static const auto& always(const LightSampler& lights) { return lights.always_.sums_; }

    static std::span<const float> weights(const Distribution& distribution) {
        return distribution.weights_;
    }
    static std::span<const double> sums(const Distribution& distribution) {
        return distribution.sums_;
    }

    static std::span<const float> weights(const Environment& environment) {
        return environment.weights_;
    }
    static std::span<const double> sums(const Environment& environment) {
        return environment.sums_;
    }
    static const Distribution& rows(const Environment& environment) { return environment.rows_; }
    static double total_weight(const Environment& environment) { return environment.total_weight_; }

    static opencl::DeviceLamp lamp(const Lamp& lamp) {
        return {lamp.centre_,
                lamp.back_,
                lamp.edge_x_,
                lamp.edge_y_,
                lamp.unit_x_,
                lamp.unit_y_,
                lamp.size_,
                lamp.strength_,
                lamp.reach_,
                lamp.extent_,
                lamp.luminance_,
                lamp.spot_edge_,
                lamp.spot_blended_,
                std::uint32_t(lamp.kind_),
                lamp.ellipse_,
                lamp.right_angled_,
                0};
    }
};

namespace opencl {
namespace {

/// Distributions one behind the other.
struct Distributions {
    std::vector<float> weights;
    std::vector<double> sums;

    DeviceDistribution add(const Distribution& distribution) {
        const auto own_weights = LightParts::weights(distribution);
        const auto own_sums = LightParts::sums(distribution);
        const DeviceDistribution place{weights.size(), sums.size(), own_sums.size()};
        weights.insert(weights.end(), own_weights.begin(), own_weights.end());
        sums.insert(sums.end(), own_sums.begin(), own_sums.end());
        return place;
    }
};

/// Lamps, and then suns; those that rays can meet refer to them.
struct LampList {
    std::vector<DeviceLamp> lamps;
    std::vector<DeviceExtendedLamp> extended;
    bool points = false, areas = false;

    void add(const LightParts::Lamps& some) {
        for (const Lamp& lamp : some.all) {
            lamps.push_back(LightParts::lamp(lamp));
            const auto kind = LightKind(lamps.back().kind);
            points |= kind == LightKind::point || kind == LightKind::spot;
            areas |= kind == LightKind::area;
        }
    }
};

/// LightSampler has copies of the lamps with extent, in the order of the lamps.
LampList list_lamps(const LightSampler& lights) {
    LampList list;
    list.add(LightParts::lamps(lights));
    list.add(LightParts::suns(lights));
    std::uint32_t lamp = 0;
    for (const auto& extended : LightParts::extended(lights)) {
        while (!(list.lamps[lamp].extent > 0.0)) ++lamp;
        list.extended.push_back({extended.share, lamp, std::uint32_t(extended.entry)});
        ++lamp;
    }
    return list;
}

std::string light_options(const LightSampler& lights, const LampList& list) {
    const auto number = [](const char* name, std::size_t value) {
        return std::string(" -D") + name + "=" + std::to_string(value);
    };
    std::string options = number("EMITTERS_ENTRY", LightParts::emitters_entry(lights)) +
                          number("WORLD_ENTRY", LightParts::world_entry(lights)) +
                          number("ODDS_ENTRIES", LightParts::world_entry(lights) + 1);
    if (LightParts::compared(lights)) options += " -DCOMPARED";
    if (!lights.empty()) options += " -DLIGHTS";
    if (!list.lamps.empty()) options += " -DLAMPS";
    if (list.points) options += " -DPOINT_LAMPS";
    if (list.areas) options += " -DAREA_LAMPS";
    if (lights.lamps_can_be_met()) options += " -DLAMPS_MET";
    return options;
}

}  // namespace

LightBuffers upload_lights(Commands& commands, const Scene& scene, const LightSampler& lights,
                           SceneConstants& constants, SceneBuffers& buffers) {
    const auto& emitters = LightParts::emitters(lights);
    const auto& environment = LightParts::environment(lights);
    const LampList list = list_lamps(lights);
    Distributions distributions;
    constants.emitters_centre = emitters.centre;
    constants.emitters_power = emitters.power;
    constants.emitters_radius = emitters.radius;
    constants.world_brightness = LightParts::world_brightness(lights);
    for (std::size_t i = 0; i < 5; ++i) constants.always[i] = LightParts::always(lights)[i];
    constants.lamps = std::uint32_t(LightParts::lamps(lights).all.size());
    constants.suns = std::uint32_t(LightParts::suns(lights).all.size());
    constants.emitters = std::uint32_t(emitters.triangles.size());
    constants.extended = std::uint32_t(list.extended.size());
    constants.lamps_by_power = distributions.add(LightParts::lamps(lights).by_power);
    constants.suns_by_power = distributions.add(LightParts::suns(lights).by_power);
    constants.emitters_by_power = distributions.add(emitters.by_power);
    std::span<const float> environment_weights;
    std::span<const double> environment_sums;
    if (environment) {
        constants.environment_weight = LightParts::total_weight(*environment);
        constants.environment_rows = distributions.add(LightParts::rows(*environment));
        environment_weights = LightParts::weights(*environment);
        environment_sums = LightParts::sums(*environment);
    }
    buffers.options += light_options(lights, list);
    buffers.has_lights = !lights.empty();
    const std::span<const double> density(emitters.density);
    return {commands.upload(std::span(list.lamps)),
            commands.upload(std::span(list.extended)),
            commands.upload(std::span(emitters.triangles)),
            commands.upload(scene.features.emitters ? density : std::span<const double>()),
            commands.upload(std::span<const float>(distributions.weights)),
            commands.upload(std::span<const double>(distributions.sums)),
            commands.upload(environment_weights),
            commands.upload(environment_sums)};
}

}  // namespace opencl
}  // namespace bvhlab
