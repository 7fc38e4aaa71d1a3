// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/leaf_clusters.h"

#include <algorithm>
#include <vector>

#include "base/parallel.h"
#include "bvh/leaf_first_order.h"

namespace bvhlab {
namespace {

/// What is known of a node once everything below it is.
struct Summary {
    double cost;  ///< least cost of the subtree, areas not divided by the root's
    std::uint32_t size;
    bool is_leaf;  ///< least cost is that of a leaf
};

Array<Summary> summarise(const BinaryBvh& bvh, const CostModel& model, const Token& token) {
    Array<Summary> nodes(bvh.node_count());
    parallel_for_each(bvh.reference_count(), 4096, token, [&](std::size_t i) {
        const std::size_t leaf = bvh.first_leaf() + i;
        nodes[leaf] = {bvh.boxes[leaf].half_area() * model.intersection, 1, true};
    });
    for_each_leaf_first(bvh, token, [&](std::uint32_t node) {
        const Summary& left = nodes[bvh.children[node].left];
        const Summary& right = nodes[bvh.children[node].right];
        const double area = bvh.boxes[node].half_area();
        const std::uint32_t size = left.size + right.size;
        const double as_leaf = area * model.intersection * double(size);
        const double as_node = area * model.traversal + left.cost + right.cost;
        nodes[node] = {std::min(as_leaf, as_node), size, node != 0 && as_leaf <= as_node};
    });
    return nodes;
}

constexpr std::size_t nodes_between_checks = 65536;

}  // namespace

LeafClusters cut_leaf_clusters(const BinaryBvh& bvh, const CostModel& model, const Token& token) {
    const Array<Summary> nodes = summarise(bvh, model, token);

    // Number what is left in depth-first order.
    LeafClusters clusters;
    std::vector<std::uint32_t> interior, pending{0};
    Array<std::uint32_t> number(bvh.node_count());
    while (!pending.empty()) {
        const std::uint32_t node = pending.back();
        pending.pop_back();
        if (nodes[node].is_leaf) {
            number[node] = std::uint32_t(clusters.roots.size());
            clusters.roots.push_back(node);
            continue;
        }
        if (interior.size() % nodes_between_checks == 0) token.check();
        number[node] = std::uint32_t(interior.size());
        interior.push_back(node);
        pending.push_back(bvh.children[node].right);
        pending.push_back(bvh.children[node].left);
    }

    clusters.top = BinaryBvh::with_references(clusters.roots.size());
    BinaryBvh& top = clusters.top;
    const auto place = [&](std::uint32_t node) {
        return nodes[node].is_leaf ? top.first_leaf() + number[node] : number[node];
    };
    parallel_for_each(clusters.roots.size(), 4096, token, [&](std::size_t i) {
        top.references[i] = std::uint32_t(i);
        top.boxes[top.first_leaf() + i] = bvh.boxes[clusters.roots[i]];
    });
    parallel_for_each(interior.size(), 4096, token, [&](std::size_t i) {
        const auto [left, right] = bvh.children[interior[i]];
        top.children[i] = {place(left), place(right)};
        top.boxes[i] = bvh.boxes[interior[i]];
    });
    return clusters;
}

BinaryBvh put_back(const BinaryBvh& top, const LeafClusters& clusters, const BinaryBvh& bvh,
                   const Token& token) {
    // A node of `top`, or of `bvh` once it is below a leaf of `top`; and where its number goes.
    struct Entry {
        std::uint32_t node;
        bool below;
        std::uint32_t* link;
    };
    BinaryBvh whole = BinaryBvh::with_references(bvh.reference_count());
    std::uint32_t interior = 0, leaves = 0, root;
    std::vector<Entry> pending{{0, false, &root}};
    while (!pending.empty()) {
        Entry entry = pending.back();
        pending.pop_back();
        if ((interior + leaves) % nodes_between_checks == 0) token.check();
        if (!entry.below && top.is_leaf(entry.node))
            entry = {clusters.roots[top.reference(entry.node)], true, entry.link};
        const BinaryBvh& from = entry.below ? bvh : top;
        if (from.is_leaf(entry.node)) {
            whole.references[leaves] = bvh.reference(entry.node);
            *entry.link = whole.first_leaf() + leaves++;
        } else {
            BinaryBvh::Children& children = whole.children[interior];
            *entry.link = interior++;
            pending.push_back({from.children[entry.node].right, entry.below, &children.right});
            pending.push_back({from.children[entry.node].left, entry.below, &children.left});
        }
        whole.boxes[*entry.link] = from.boxes[entry.node];
    }
    return whole;
}

}  // namespace bvhlab
