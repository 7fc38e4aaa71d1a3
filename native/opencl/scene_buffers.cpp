// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/scene_buffers.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "render/energy.h"
#include "render/microfacet.h"

namespace bvhlab::opencl {
namespace {

template <class T>
Buffer<T> upload_if(Commands& commands, bool needed, std::span<const T> values) {
    return needed ? commands.upload(values) : commands.buffer<T>(0);
}

std::vector<bool> materials_used(const Scene& scene) {
    std::vector<bool> used(scene.materials.size(), false);
    for (const std::uint32_t material : scene.material_index) used[material] = true;
    return used;
}

bool may_be_above_zero(const NumberInput& input) {
    return input.lookup != no_lookup || input.value > 0.0F;
}

bool may_be_below_one(const NumberInput& input) {
    return input.lookup != no_lookup || input.value < 1.0F;
}

bool may_be_rough(const Component& component) {
    const float roughness = component.roughness.value;
    return component.roughness.lookup != no_lookup || roughness * roughness >= least_alpha;
}

// --- materials ----------------------------------------------------------------------------------

/// Tables of energy in the order in which materials ask for them, each once.
class EnergyTables {
public:
    EnergyTables() {
        const ReflectionEnergy& reflection = reflection_energy();
        values_.assign(reflection.average.begin(), reflection.average.end());
        add(reflection.albedo);
    }

    std::uint32_t coat(float ior) {
        const CoatEnergy& energy = coat_energy(ior);
        const auto [place, is_new] = known_.try_emplace(&energy, count_);
        if (is_new) add(energy.albedo);
        return place->second;
    }

    std::uint32_t glass(float ior) {
        const DielectricEnergy& energy = dielectric_energy(ior);
        const auto [place, is_new] = known_.try_emplace(&energy, count_);
        if (is_new) {
            add(energy.glass[0]);
            add(energy.glass[1]);
            add(energy.refraction);
        }
        return place->second;
    }

    const std::vector<float>& values() const { return values_; }

private:
    void add(EnergyTable table) {
        for (int row = 0; row < EnergyTable::roughnesses; ++row)
            for (int column = 0; column < EnergyTable::cosines; ++column)
                values_.push_back(table.node(row, column));
        ++count_;
    }

    std::vector<float> values_;
    std::map<const void*, std::uint32_t> known_;
    std::uint32_t count_ = 0;
};

bool has_glass(const Component& component) {
    return component.model == Model::glass || component.model == Model::refraction ||
           (component.model == Model::principled && may_be_above_zero(component.transmission));
}

bool has_coat(const Component& component) {
    return component.model == Model::principled && may_be_below_one(component.metallic) &&
           may_be_below_one(component.transmission);
}

DeviceComponent device_component(const Component& component) {
    return {std::uint32_t(component.model),
            component.weight,
            component.color,
            component.roughness,
            component.metallic,
            component.transmission,
            component.ior,
            scaled_ior(component.ior, component.specular),
            no_table,
            no_table};
}

/// Lobes that a material of these components can have, diffuse reflection among them.
std::size_t lobes_of(const Material& material) {
    std::size_t lobes = 1;
    for (const Component& component : material.components) {
        const bool principled = component.model == Model::principled;
        if (principled)
            lobes += 1U + may_be_above_zero(component.metallic) + has_glass(component);
        else if (component.model != Model::diffuse && component.model != Model::transparent)
            lobes += 1;
    }
    return lobes;
}

void upload_materials(Commands& commands, const Scene& scene, SceneBuffers& buffers) {
    const std::vector<bool> used = materials_used(scene);
    const bool gloss = scene.features.gloss;
    std::vector<DeviceMaterial> materials;
    std::vector<DeviceComponent> components;
    std::vector<float> energy;
    std::size_t most_lobes = 1;
    std::unique_ptr<EnergyTables> tables;
    if (gloss) tables = std::make_unique<EnergyTables>();
    for (std::size_t i = 0; i < scene.materials.size(); ++i) {
        const Material& material = scene.materials[i];
        materials.push_back({std::uint32_t(components.size()),
                             std::uint32_t(material.components.size()), material.emission});
        if (used[i]) most_lobes = std::max(most_lobes, lobes_of(material));
        for (const Component& component : material.components) {
            DeviceComponent& added = components.emplace_back(device_component(component));
            if (!gloss || !used[i] || !may_be_rough(component)) continue;
            if (has_coat(component)) added.coat_table = tables->coat(added.coat_ior);
            if (has_glass(component)) added.glass_table = tables->glass(component.ior);
        }
    }
    buffers.materials = commands.upload(std::span<const DeviceMaterial>(materials));
    buffers.components = commands.upload(std::span<const DeviceComponent>(components));
    buffers.energy = upload_if<float>(
        commands, gloss,
        tables ? std::span<const float>(tables->values()) : std::span<const float>());
    if (gloss) buffers.options += " -DGLOSS -DMOST_LOBES=" + std::to_string(most_lobes);
}

// --- textures -----------------------------------------------------------------------------------

/// Which textures are looked up.
std::vector<bool> textures_used(const Scene& scene) {
    std::vector<bool> used(scene.textures.size(), false);
    const std::vector<bool> materials = materials_used(scene);
    const auto use = [&](std::uint32_t lookup) {
        if (lookup != no_lookup) used[scene.lookups[lookup].texture] = true;
    };
    for (std::size_t i = 0; i < scene.materials.size() && scene.features.textures; ++i) {
        if (!materials[i]) continue;
        use(scene.materials[i].emission.lookup);
        for (const Component& component : scene.materials[i].components) {
            use(component.color.lookup);
            for (const NumberInput& input : {component.weight, component.roughness,
                                             component.metallic, component.transmission})
                use(input.lookup);
        }
    }
    if (scene.features.environment) used[scene.world.texture] = true;
    return used;
}

/// Linear values of all sRGB bytes and one more (scene/texture.cpp), as its look-up gives them.
std::vector<float> decoded_bytes() {
    std::vector<float> values;
    Texture one{.channels = 1, .bytes = {0}, .floats = {}, .srgb = true, .closest = true};
    for (int byte = 0; byte <= 256; ++byte) {
        one.bytes[0] = std::uint8_t(std::min(byte, 255));
        values.push_back(look_up(one, glm::vec2(0.5F)).r);
    }
    return values;
}

/// Adds a texture's floats as they are interpolated: finite, and linear.
void add_floats(const Texture& texture, std::vector<float>& values) {
    Texture one{.channels = 1, .bytes = {}, .floats = {0.0F}, .srgb = true, .closest = true};
    for (std::size_t i = 0; i < texture.floats.size(); ++i) {
        float value = std::isfinite(texture.floats[i]) ? texture.floats[i] : 0.0F;
        if (texture.srgb && i % texture.channels < 3) {
            one.floats[0] = value;
            value = look_up(one, glm::vec2(0.5F)).r;
        }
        values.push_back(value);
    }
}

DeviceLookup device_lookup(const Lookup& lookup) {
    DeviceLookup result{lookup.texture, std::uint32_t(lookup.channel), {}, {}, {}};
    for (int i = 0; i < 3; ++i) {
        result.scale[i] = lookup.scale[i];
        result.offset[i] = lookup.offset[i];
        result.mapping[2 * i] = lookup.mapping[i].x;
        result.mapping[2 * i + 1] = lookup.mapping[i].y;
    }
    return result;
}

void upload_textures(Commands& commands, const Scene& scene, SceneBuffers& buffers) {
    const std::vector<bool> used = textures_used(scene);
    std::vector<DeviceTexture> textures;
    std::vector<std::uint8_t> bytes;
    std::vector<float> floats;
    bool any_srgb_bytes = false;
    for (std::size_t i = 0; i < used.size(); ++i) {
        const Texture& texture = *scene.textures[i];
        const bool has_bytes = !texture.bytes.empty();
        textures.push_back({has_bytes ? bytes.size() : floats.size(), texture.width, texture.height,
                            texture.channels, has_bytes, texture.srgb, texture.closest,
                            std::uint32_t(texture.wrap), 0});
        if (!used[i]) continue;
        any_srgb_bytes |= has_bytes && texture.srgb;
        bytes.insert(bytes.end(), texture.bytes.begin(), texture.bytes.end());
        add_floats(texture, floats);
    }
    std::vector<DeviceLookup> lookups;
    for (const Lookup& lookup : scene.lookups) lookups.push_back(device_lookup(lookup));
    const bool any = scene.features.textures || scene.features.environment;
    buffers.textures = upload_if<DeviceTexture>(commands, any, textures);
    buffers.lookups = upload_if<DeviceLookup>(commands, scene.features.textures, lookups);
    buffers.texture_bytes = commands.upload(std::span<const std::uint8_t>(bytes));
    buffers.texture_floats = commands.upload(std::span<const float>(floats));
    buffers.decoded = upload_if<float>(commands, any_srgb_bytes, decoded_bytes());
}

/// The features that kernels are told of, but for lights.
std::string feature_options(const Features& features) {
    std::string options;
    const auto add = [&](bool has, const char* name) {
        if (has) options += std::string(" -D") + name;
    };
    add(features.textures, "TEXTURES");
    add(features.smooth, "SMOOTH");
    add(features.transmission, "TRANSMISSION");
    add(features.transparency, "TRANSPARENCY");
    add(features.emitters, "EMITTERS");
    add(features.world, "WORLD");
    add(features.environment, "ENVIRONMENT");
    return options;
}

}  // namespace

SceneBuffers upload_scene(Commands& commands, const Scene& scene, const LightSampler& lights) {
    const Features& features = scene.features;
    SceneBuffers buffers;
    buffers.options = feature_options(features);
    buffers.vertices = commands.upload(std::span(scene.mesh->vertices));
    buffers.triangles = commands.upload(std::span(scene.mesh->triangles));
    buffers.material_index = commands.upload(std::span(scene.material_index));
    buffers.uvs = upload_if<glm::vec2>(commands, features.textures, scene.uvs);
    buffers.normals = upload_if<glm::vec3>(commands, features.smooth, scene.normals);
    upload_materials(commands, scene, buffers);
    upload_textures(commands, scene, buffers);
    SceneConstants constants{};
    constants.to_texture = scene.world.to_texture;
    constants.world = scene.world.color;
    constants.world_texture = scene.world.texture;
    buffers.lights = upload_lights(commands, scene, lights, constants, buffers);
    buffers.constants = commands.upload(std::span<const SceneConstants>(&constants, 1));
    return buffers;
}

}  // namespace bvhlab::opencl
