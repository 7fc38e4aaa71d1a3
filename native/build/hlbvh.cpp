// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/hlbvh.h"

#include <algorithm>
#include <glm/gtc/type_precision.hpp>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "build/morton.h"
#include "build/morton_order.h"

namespace bvhlab {
namespace {

constexpr int most_cells = 1 << 7;           // per axis
constexpr std::size_t smallest_task = 4096;  // references below which one thread builds a subtree

/// The references of one cell: the places first..last of the Morton order.
struct Cluster {
    std::uint32_t first, last;
    glm::u8vec3 cell;
    Box box;

    std::uint32_t size() const { return last - first + 1; }
};

/// The cell that the leading bits of a code stand for: its bits in turn, z first.
glm::u8vec3 cell_of(std::uint64_t code, int bits) {
    glm::u8vec3 cell(0);
    for (int bit = 0; bit < bits; ++bit) {
        std::uint8_t& coordinate = cell[2 - bit % 3];
        coordinate = std::uint8_t(coordinate << 1 | (code >> (morton_bits - 1 - bit) & 1));
    }
    return cell;
}

/// Runs of codes with the same leading bits (Pantaleoni and Luebke 2010).
std::vector<Cluster> find_clusters(const MortonOrder& order, int bits, const Token& token) {
    const auto count = std::uint32_t(order.codes.size());
    const auto prefix = [&](std::uint32_t i) { return order.codes[i] >> (morton_bits - bits); };
    std::vector<Cluster> clusters;
    for (std::uint32_t first = 0, i = 1; i <= count; ++i) {
        if (i < count && prefix(i) == prefix(first)) continue;
        clusters.push_back({first, i - 1, cell_of(order.codes[first], bits), Box::empty()});
        first = i;
    }
    parallel_for_each(clusters.size(), 16, token, [&](std::size_t i) {
        Cluster& cluster = clusters[i];
        for (std::uint32_t place = cluster.first; place <= cluster.last; ++place)
            cluster.box.grow(order.boxes[order.references[place]]);
    });
    return clusters;
}

/// Clusters in cells below `cell` on `axis` go left.
struct Plane {
    double cost = std::numeric_limits<double>::infinity();
    int axis = 0;
    int cell = 0;
};

struct Bin {
    Box box;
    std::uint32_t clusters;
};

/// Replaces `best` by the plane of least cost on `axis`, if less: the areas of both sides, weighed
/// by the number of clusters.
void find_plane(std::span<const Cluster> clusters, int axis, Plane& best) {
    const auto cell_of = [&](const Cluster& cluster) { return int(cluster.cell[axis]); };
    const auto [lowest, highest] = std::ranges::minmax_element(clusters, {}, cell_of);
    const int low = cell_of(*lowest), high = cell_of(*highest);
    if (low == high) return;

    // Fill the bins of the cells low..high.
    Bin bins[most_cells];
    std::fill(bins + low, bins + high + 1, Bin{Box::empty(), 0});
    for (const Cluster& cluster : clusters) {
        Bin& bin = bins[cluster.cell[axis]];
        bin.box.grow(cluster.box);
        ++bin.clusters;
    }

    // Sweep the planes between them.
    double right_costs[most_cells];
    Bin right{Box::empty(), 0}, left{Box::empty(), 0};
    for (int cell = high; cell > low; --cell) {
        right.box.grow(bins[cell].box);
        right.clusters += bins[cell].clusters;
        right_costs[cell] = right.box.half_area() * right.clusters;
    }
    for (int cell = low + 1; cell <= high; ++cell) {
        left.box.grow(bins[cell - 1].box);
        left.clusters += bins[cell - 1].clusters;
        const double cost = left.box.half_area() * left.clusters + right_costs[cell];
        if (cost < best.cost) best = {cost, axis, cell};
    }
}

std::uint32_t reference_count(std::span<const Cluster> clusters) {
    return std::accumulate(
        clusters.begin(), clusters.end(), 0U,
        [](std::uint32_t sum, const Cluster& cluster) { return sum + cluster.size(); });
}

/// Builds the levels above the clusters and hangs the clusters' own subtrees below. A subtree of
/// n references has its interior nodes at node, ..., node + n - 2 and its leaves from number `leaf`
/// on, both in depth-first order.
struct TopLevels {
    const MortonOrder& order;
    BinaryBvh& bvh;
    const Token& token;

    /// Returns the root of the subtree; `count` is its number of references. Orders the clusters
    /// anew. Each level divides the cells on one axis, so recursion is at most 3 * most_cells deep.
    std::uint32_t build(std::span<Cluster> clusters, std::uint32_t count, std::uint32_t node,
                        std::uint32_t leaf) const {
        if (clusters.size() == 1) return build_cluster(clusters[0], node, leaf);
        token.check();
        Plane plane;
        for (int axis = 0; axis < 3; ++axis) find_plane(clusters, axis, plane);
        const auto middle = std::stable_partition(
            clusters.begin(), clusters.end(),
            [&](const Cluster& cluster) { return cluster.cell[plane.axis] < plane.cell; });
        const std::span<Cluster> left_clusters(clusters.begin(), middle);
        const std::span<Cluster> right_clusters(middle, clusters.end());
        const std::uint32_t left_count = reference_count(left_clusters);

        std::uint32_t left, right;
        const auto build_left = [&] { left = build(left_clusters, left_count, node + 1, leaf); };
        const auto build_right = [&] {
            right = build(right_clusters, count - left_count, node + left_count, leaf + left_count);
        };
        if (count < smallest_task) {
            build_left();
            build_right();
        } else {
            parallel_invoke(build_left, build_right);
        }
        bvh.children[node] = {left, right};
        bvh.boxes[node] = unite(bvh.boxes[left], bvh.boxes[right]);
        return node;
    }

    std::uint32_t build_cluster(const Cluster& cluster, std::uint32_t node,
                                std::uint32_t leaf) const {
        const std::uint32_t leaf_shift = leaf - cluster.first;
        parallel_for_each(cluster.size(), smallest_task, token, [&](std::size_t i) {
            const std::uint32_t reference = order.references[cluster.first + i];
            bvh.references[leaf + i] = reference;
            bvh.boxes[bvh.first_leaf() + leaf + i] = order.boxes[reference];
        });
        token.check();
        return LbvhSubtrees{order.codes, bvh, token, leaf_shift}.build(node, cluster.first,
                                                                       cluster.last);
    }
};

}  // namespace

HlbvhConfig hlbvh_config(const Parameters& parameters) {
    return {int(parameters.at("sah_bits"))};
}

BinaryBvh build_hlbvh(const Mesh& mesh, const HlbvhConfig& config, Token& token) {
    token.begin("building HLBVH");
    const MortonOrder order = morton_order(mesh, token);
    token.advance(0.5F);
    std::vector<Cluster> clusters = find_clusters(order, config.sah_bits, token);
    token.advance(0.6F);

    BinaryBvh bvh = BinaryBvh::with_references(mesh.size());
    TopLevels{order, bvh, token}.build(clusters, std::uint32_t(mesh.size()), 0, 0);
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab
