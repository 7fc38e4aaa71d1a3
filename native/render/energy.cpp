// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/energy.h"

#include <tbb/task_arena.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "render/microfacet.h"

namespace bvhlab {
namespace {

/// Nodes of the quadrature below. Kinks, where light starts to be reflected totally or leaves below
/// the surface, lie across the nodes at all places, so that their errors cancel: what is left is
/// about 3e-4 of a mean, and 2e-3 just around total reflection.
constexpr int quadrature_nodes = 3072;

struct QuadratureNode {
    glm::vec2 turn;
    float height, weight;
};

/// A golden-ratio lattice on the two arguments of visible_normal, the first of which covers half a
/// turn, as the other half mirrors it. Heights are t^2 (3 - 2t) for even t, which makes the square
/// roots at both ends of the integrands smooth.
std::vector<QuadratureNode> quadrature() {
    std::vector<QuadratureNode> nodes;
    for (int i = 0; i < quadrature_nodes; ++i) {
        const double turns = i * (std::numbers::phi - 1.0), t = (i + 0.5) / quadrature_nodes;
        const double angle = std::numbers::pi * (turns - std::floor(turns));
        nodes.push_back({glm::vec2(std::cos(angle), std::sin(angle)),
                         float(t * t * (3.0 - 2.0 * t)),
                         float(6.0 * t * (1.0 - t) / quadrature_nodes)});
    }
    return nodes;
}

/// Mean of function(o, h) over the microfacet normals that a viewer sees.
template <class Function>
auto mean_over_normals(float cosine, float alpha, const Function& function) {
    static const std::vector<QuadratureNode> nodes = quadrature();
    const glm::vec3 o(std::sqrt(1.0F - cosine * cosine), 0.0F, cosine);
    const glm::vec3 stretched = stretch(o, alpha);
    decltype(function(o, o)) sum(0.0F);
    for (const QuadratureNode& node : nodes)
        sum += node.weight * function(o, visible_normal(stretched, alpha, node.turn, node.height));
    return sum;
}

/// Share of the light from a microfacet that no other takes away, on its way in direction i.
float unshadowed(const glm::vec3& o, float cos_i, float alpha) {
    if (cos_i <= 0.0F) return 0.0F;
    return masking_shadowing(o.z, cos_i, alpha) / masking(o.z, alpha);
}

float unshadowed_reflection(const glm::vec3& o, const glm::vec3& h, float alpha) {
    return unshadowed(o, 2.0F * glm::dot(o, h) * h.z - o.z, alpha);
}

float reflection_albedo(float cosine, float roughness) {
    const float alpha = roughness * roughness;
    if (alpha < least_alpha) return 1.0F;
    return mean_over_normals(cosine, alpha, [&](const glm::vec3& o, const glm::vec3& h) {
        return unshadowed_reflection(o, h, alpha);
    });
}

float coat_albedo(float cosine, float roughness, float ior) {
    const float alpha = roughness * roughness;
    if (alpha < least_alpha) return dielectric_reflectance(cosine, ior);
    return mean_over_normals(cosine, alpha, [&](const glm::vec3& o, const glm::vec3& h) {
        return dielectric_reflectance(glm::dot(o, h), ior) * unshadowed_reflection(o, h, alpha);
    });
}

struct DielectricShares {
    float glass;       ///< of all light, what is reflected or refracted and comes through
    float refraction;  ///< of the light that can be refracted, what comes through
};

DielectricShares dielectric_shares(float cosine, float roughness, float eta) {
    const float alpha = roughness * roughness;
    if (alpha < least_alpha || eta == 1.0F) return {1.0F, 1.0F};
    const glm::vec3 shares =
        mean_over_normals(cosine, alpha, [&](const glm::vec3& o, const glm::vec3& h) {
            const float reflected = dielectric_reflectance(glm::dot(o, h), eta);
            const float kept = reflected * unshadowed_reflection(o, h, alpha);
            if (reflected >= 1.0F) return glm::vec3(kept, 0.0F, 0.0F);
            const float through = unshadowed(o, -refracted(o, h, eta).z, alpha);
            return glm::vec3(kept + (1.0F - reflected) * through, through, 1.0F);
        });
    return {shares.x, shares.z > 0.0F ? shares.y / shares.z : 1.0F};
}

/// Calls function(row, column, cosine, roughness) for each node, on all threads. Isolated: a thread
/// that waits for the others must not take up a task that asks for the same table.
template <class Function>
void for_each_node(const Function& function) {
    tbb::this_task_arena::isolate([&] {
        parallel_for_each(EnergyTable::roughnesses, 1, Token(), [&](std::size_t i) {
            const int row = int(i);
            for (int column = 0; column < EnergyTable::cosines; ++column)
                function(row, column, EnergyTable::cosine_of(column),
                         EnergyTable::roughness_of(row));
        });
    });
}

/// Cosine-weighted mean of a row: the integral of 2 cos E over the cosine.
float average_of_row(const EnergyTable& table, int row) {
    constexpr int nodes = 1024;
    double sum = 0.0;
    for (int i = 0; i < nodes; ++i) {
        const float cosine = (float(i) + 0.5F) / float(nodes);
        sum += 2.0 * double(cosine * table.at(cosine, EnergyTable::roughness_of(row)));
    }
    return float(sum / nodes);
}

std::unique_ptr<CoatEnergy> make_coat(float ior) {
    auto made = std::make_unique<CoatEnergy>();
    for_each_node([&](int row, int column, float cosine, float roughness) {
        made->albedo.node(row, column) = coat_albedo(cosine, roughness, ior);
    });
    return made;
}

std::unique_ptr<DielectricEnergy> make_dielectric(float ior) {
    auto made = std::make_unique<DielectricEnergy>();
    for (const int side : {0, 1})
        for_each_node([&](int row, int column, float cosine, float roughness) {
            const DielectricShares shares =
                dielectric_shares(cosine, roughness, side == 0 ? ior : 1.0F / ior);
            made->glass[side].node(row, column) = shares.glass;
            if (side == 0) made->refraction.node(row, column) = shares.refraction;
        });
    return made;
}

/// Tables by index of refraction, in thousandths above 1.
template <class Table>
class Shelf {
public:
    template <class Make>
    const Table& find(float ior, const Make& make) {
        const auto place = std::size_t(std::lround(std::clamp(ior - 1.0F, 0.0F, 9.0F) * 1000.0F));
        if (const Table* found = shelf_[place].load(std::memory_order_acquire)) return *found;
        const std::lock_guard lock(making_);
        if (!shelf_[place].load(std::memory_order_relaxed)) {
            owned_.push_back(make(1.0F + float(place) / 1000.0F));
            shelf_[place].store(owned_.back().get(), std::memory_order_release);
        }
        return *shelf_[place].load(std::memory_order_relaxed);
    }

private:
    std::array<std::atomic<const Table*>, 9001> shelf_{};
    std::vector<std::unique_ptr<Table>> owned_;
    std::mutex making_;
};

}  // namespace

float ReflectionEnergy::average_at(float roughness) const {
    const float y = std::clamp(roughness, 0.0F, 1.0F) * float(EnergyTable::roughnesses - 1);
    const int row = std::min(int(y), EnergyTable::roughnesses - 2);
    const float first = average[std::size_t(row)], second = average[std::size_t(row) + 1];
    return first + (y - float(row)) * (second - first);
}

const ReflectionEnergy& reflection_energy() {
    static const ReflectionEnergy energy = [] {
        ReflectionEnergy made;
        for_each_node([&](int row, int column, float cosine, float roughness) {
            made.albedo.node(row, column) = reflection_albedo(cosine, roughness);
        });
        for (int row = 0; row < EnergyTable::roughnesses; ++row)
            made.average[std::size_t(row)] = average_of_row(made.albedo, row);
        return made;
    }();
    return energy;
}

const DielectricEnergy& dielectric_energy(float ior) {
    static Shelf<DielectricEnergy> shelf;
    return shelf.find(ior, make_dielectric);
}

const CoatEnergy& coat_energy(float ior) {
    static Shelf<CoatEnergy> shelf;
    return shelf.find(ior, make_coat);
}

}  // namespace bvhlab
