// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/hlbvh.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <bit>
#include <limits>
#include <map>
#include <vector>

#include "base/parallel.h"
#include "build/lbvh.h"
#include "build/morton.h"
#include "build/morton_order.h"
#include "bvh/validate.h"
#include "meshes.h"
#include "same_tree.h"
#include "topology.h"

namespace bvhlab {
namespace {

using namespace test;

BinaryBvh build(const Mesh& mesh, int sah_bits = 15) {
    Token token;
    return build_hlbvh(mesh, {sah_bits}, token);
}

/// The builder again, slow and plain: sets of clusters by cell, and every plane of every node.
class PlainHlbvh {
public:
    PlainHlbvh(const Mesh& mesh, int sah_bits) : order_(morton_order(mesh, Token())) {
        for (std::uint32_t place = 0; place < mesh.size(); ++place) {
            Cell cell{};
            for (int bit = 0; bit < sah_bits; ++bit) {
                int& coordinate = cell[std::size_t(2 - bit % 3)];
                coordinate = 2 * coordinate + int(order_.codes[place] >> (59 - bit) & 1);
            }
            clusters_[cell].push_back(place);
        }
    }

    std::string topology() const { return top(clusters_); }

private:
    using Cell = std::array<int, 3>;
    using Clusters = std::map<Cell, std::vector<std::uint32_t>>;

    double cost(const Clusters& clusters) const {
        Box box = Box::empty();
        for (const auto& [cell, places] : clusters)
            for (const std::uint32_t place : places)
                box.grow(order_.boxes[order_.references[place]]);
        return box.half_area() * double(clusters.size());
    }

    std::string top(const Clusters& clusters) const {
        if (clusters.size() == 1) return bottom(clusters.begin()->second);
        double least = std::numeric_limits<double>::infinity();
        Clusters best[2];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            for (int plane = 1; plane < 128; ++plane) {
                Clusters sides[2];
                for (const auto& cluster : clusters)
                    sides[cluster.first[axis] >= plane].insert(cluster);
                if (sides[0].empty() || sides[1].empty()) continue;
                const double both = cost(sides[0]) + cost(sides[1]);
                if (both >= least) continue;
                least = both;
                best[0] = sides[0];
                best[1] = sides[1];
            }
        }
        return joined(top(best[0]), top(best[1]));
    }

    /// Divided at the highest bit of the codes, then of the places, that is not the same for all.
    std::string bottom(const std::vector<std::uint32_t>& places) const {
        if (places.size() == 1) return std::to_string(order_.references[places[0]]);
        const std::uint32_t first = places.front(), last = places.back();
        const std::uint64_t codes = order_.codes[first] ^ order_.codes[last];
        std::vector<std::uint32_t> sides[2];
        for (const std::uint32_t place : places)
            sides[codes != 0 ? (order_.codes[place] & std::bit_floor(codes)) != 0
                             : (place & std::bit_floor(first ^ last)) != 0]
                .push_back(place);
        return joined(bottom(sides[0]), bottom(sides[1]));
    }

    MortonOrder order_;
    Clusters clusters_;
};

Mesh with_doubles(Mesh mesh) {
    const std::size_t count = mesh.size();
    for (std::size_t i = 0; i < count; i += 2) mesh.triangles.push_back(mesh.triangles[i]);
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

Mesh moved(Mesh mesh, glm::vec3 by) {
    for (glm::vec3& vertex : mesh.vertices) vertex += by;
    return make_mesh(std::move(mesh.vertices), std::move(mesh.triangles));
}

TEST(Hlbvh, IsThePlainOne) {
    for (const int bits : {3, 7, 9, 15, 20})
        for (const Mesh& mesh :
             {random_soup(150), with_doubles(random_soup(60)), sphere(6, glm::vec3(-5.0F)),
              moved(random_soup(100, 0.5F), {-0.5F, -10.0F, 3.0F}), random_soup(2)})
            EXPECT_EQ(topology(build(mesh, bits)), PlainHlbvh(mesh, bits).topology());
}

TEST(Hlbvh, IsLbvhWhereAllShareACell) {
    const Mesh mesh = copies(5000);
    Token token;
    EXPECT_EQ(topology(build(mesh)), topology(build_lbvh(mesh, token)));
}

TEST(Hlbvh, IsValidOnEveryShapeOfInput) {
    for (const Mesh& mesh : {random_soup(1), random_soup(2), random_soup(3), random_soup(20000),
                             copies(1), copies(100000), growing_chain(3000, 1.03), sphere(40)})
        EXPECT_NO_THROW(validate(build(mesh), mesh));
}

TEST(Hlbvh, IsTheSameForAnyThreadCount) {
    const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 8);
    for (const Mesh& mesh : {random_soup(50000), copies(50000)}) {
        const BinaryBvh one = with_threads(1, [&] { return build(mesh); });
        const BinaryBvh many = with_threads(7, [&] { return build(mesh); });
        EXPECT_TRUE(same(one, many));
    }
}

TEST(Hlbvh, NumbersNodesDepthFirst) {
    const BinaryBvh bvh = build(random_soup(9000));
    std::vector<std::uint32_t> waiting{0};
    std::uint32_t next_node = 0, next_leaf = bvh.first_leaf();
    while (!waiting.empty()) {
        const std::uint32_t node = waiting.back();
        waiting.pop_back();
        ASSERT_EQ(node, bvh.is_leaf(node) ? next_leaf++ : next_node++);
        if (bvh.is_leaf(node)) continue;
        waiting.push_back(bvh.children[node].right);
        waiting.push_back(bvh.children[node].left);
    }
}

TEST(Hlbvh, StopsWhenCancelled) {
    Token token;
    token.cancel();
    EXPECT_THROW(build_hlbvh(random_soup(10), {}, token), Cancelled);
    EXPECT_THROW(build_hlbvh(random_soup(20000), {}, token), Cancelled);
}

}  // namespace
}  // namespace bvhlab
