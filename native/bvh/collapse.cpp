// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/collapse.h"

#include <array>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/parallel.h"
#include "bvh/layout.h"
#include "bvh/leaf_first_order.h"

namespace bvhlab {
namespace {

/// The dynamic programme of Ylitie et al. 2017, section 3.1. For each binary node N and j = 1..k-1
/// it finds the least cost C(N, j) of representing N's subtree by a forest of at most j wide trees.
/// Leaves of more than `most_references` are not made.
template <class Tree>
class DynamicProgramme {
public:
    static constexpr unsigned K = Tree::branching;

    DynamicProgramme(const BinaryBvh& binary, const CostModel& model, std::uint32_t most_references)
        : binary_(binary),
          traversal_(float(model.traversal)),
          intersection_(float(model.intersection)),
          most_references_(most_references),
          plans_(binary.children.size()) {
        const double root_area = binary.boxes[0].half_area();
        scale_ = root_area > 0.0 ? 1.0 / root_area : 0.0;
    }

    /// Plans `node`, whose children are planned.
    void plan(std::uint32_t node) {
        const auto [left, right] = binary_.children[node];
        const Costs left_costs = costs(left), right_costs = costs(right);
        Plan<K>& plan = plans_[node];
        plan.size = size(left) + size(right);

        Costs best;  // best[j] = min over i of C(left, i) + C(right, j - i), for j = 2..k
        Shares share{};
        if (binary_.is_leaf(left) || binary_.is_leaf(right))
            add_leaf(left_costs, right_costs, binary_.is_leaf(left), best, share);
        else
            share_out(left_costs, right_costs, best, share);

        // One tree: a leaf of all references, or a wide node over a forest of k. A tie makes a
        // leaf.
        const float relative_area = area(node);
        const float as_leaf = relative_area * intersection_ * float(Tree::charged(plan.size));
        const float as_node = relative_area * traversal_ + best[K];
        const bool leaf = as_leaf <= as_node && plan.size <= most_references_;
        plan.cost[1] = leaf ? as_leaf : as_node;
        plan.left_share[1] = leaf ? Plan<K>::leaf : std::uint8_t(share[K]);
        plan.node_share = std::uint8_t(share[K]);

        // At most j trees: j - 1 of them where more do not help.
        for (unsigned j = 2; j < K; ++j) {
            const bool fewer = plan.cost[j - 1] <= best[j];
            plan.cost[j] = fewer ? plan.cost[j - 1] : best[j];
            plan.left_share[j] = fewer ? Plan<K>::fewer : std::uint8_t(share[j]);
        }
    }

    Array<Plan<K>> take() { return std::move(plans_); }

private:
    using Costs = std::array<float, K + 1>;
    static constexpr float infinity = std::numeric_limits<float>::infinity();

    using Shares = std::array<std::int32_t, K + 1>;

    /// A leaf takes one tree and more do not help it: the other child has the rest.
    static void add_leaf(const Costs& left, const Costs& right, bool left_is_leaf, Costs& best,
                         Shares& share) {
        for (unsigned j = 2; j <= K; ++j) {
            best[j] = left_is_leaf ? left[1] + right[j - 1] : left[j - 1] + right[1];
            share[j] = left_is_leaf ? 1 : std::int32_t(j - 1);
        }
    }

    /// All j at once, so that the compiler can use SIMD lanes; infinite entries stand where j - i
    /// is not in 1..k-1.
    static void share_out(const Costs& left, const Costs& right, Costs& best, Shares& share) {
        std::array<float, 2 * K + 1> shifted;
        shifted.fill(infinity);
        for (unsigned j = 1; j < K; ++j) shifted[K + j] = right[j];
        best.fill(infinity);
        for (unsigned i = 1; i < K; ++i) {
            for (unsigned j = 1; j <= K; ++j) {
                const float cost = left[i] + shifted[K + j - i];
                share[j] = cost < best[j] ? std::int32_t(i) : share[j];
                best[j] = cost < best[j] ? cost : best[j];
            }
        }
    }

    /// Area relative to the root's; 1 in a scene without area, so that leaves are still compared by
    /// tests.
    float area(std::uint32_t node) const {
        return scale_ > 0.0 ? float(binary_.boxes[node].half_area() * scale_) : 1.0F;
    }

    std::uint32_t size(std::uint32_t node) const {
        return binary_.is_leaf(node) ? 1 : plans_[node].size;
    }

    Costs costs(std::uint32_t node) const {
        if (!binary_.is_leaf(node)) return plans_[node].cost;
        Costs costs;
        costs.fill(area(node) * intersection_ * float(Tree::charged(1)));
        return costs;
    }

    const BinaryBvh& binary_;
    float traversal_, intersection_;
    std::uint32_t most_references_;
    double scale_;
    Array<Plan<K>> plans_;
};

template <class Tree>
Array<Plan<Tree::branching>> plan(const BinaryBvh& binary, const CostModel& model,
                                  std::uint32_t most_references, Token& token) {
    constexpr std::size_t most = std::size_t(1) << 28;
    if (binary.reference_count() > most)
        throw std::length_error("the tree has more than 2^28 references");
    token.begin("collapsing");
    DynamicProgramme<Tree> programme(binary, model, most_references);
    for_each_leaf_first(binary, token, [&](std::uint32_t node) { programme.plan(node); });
    token.advance(0.5F);
    return programme.take();
}

template <unsigned K>
Bvh collapse_to(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, const CostModel& model,
                Token& token) {
    constexpr std::uint32_t any = std::numeric_limits<std::uint32_t>::max();
    const auto plans = plan<WideBvh<K>>(binary, model, any, token);
    return breadth_first_layout<K>(binary, plans, std::move(mesh), token);
}

}  // namespace

Bvh collapse(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, unsigned branching,
             const CostModel& model, Token& token) {
    switch (branching) {
        case 2:
            return collapse_to<2>(binary, std::move(mesh), model, token);
        case 4:
            return collapse_to<4>(binary, std::move(mesh), model, token);
        case 8:
            return collapse_to<8>(binary, std::move(mesh), model, token);
        default:
            throw std::invalid_argument("branching must be 2, 4 or 8");
    }
}

Bvh compress(const BinaryBvh& binary, std::shared_ptr<const Mesh> mesh, const CostModel& model,
             Token& token) {
    const auto plans = plan<CompressedBvh>(binary, model, CompressedNode::most_references, token);
    return compressed_layout(binary, plans, std::move(mesh), token);
}

}  // namespace bvhlab
