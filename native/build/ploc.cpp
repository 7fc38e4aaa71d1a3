// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/ploc.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "build/morton_order.h"
#include "build/nearest_cluster.h"
#include "bvh/depth_first.h"

namespace bvhlab {
namespace {

constexpr std::uint32_t block_size = 1024;  // clusters that one task handles
constexpr std::uint32_t no_partner = 0xFFFFFFFFU;

// An iteration stalls that merges less than this share of a row longer than that. Of such rows in
// scenes 0.05 to 0.4 merges.
constexpr double stalled_share = 1.0 / 64.0;
constexpr std::uint32_t longest_stalled_row = 256;

/// Scales boxes by the power of two that makes the longest side of the scene 1 to 2, for areas in
/// float. Exact but for sides below 1e-38 of that, and areas vanish only for sides below 1e-19.
class UnitScale {
public:
    explicit UnitScale(const Box& scene) {
        double longest = 0.0;
        for (int axis = 0; axis < 3; ++axis)
            longest = std::max(longest, double(scene.upper[axis]) - double(scene.lower[axis]));
        if (longest > 0.0) factor_ = std::ldexp(1.0, -std::ilogb(longest));
    }

    Box operator()(const Box& box) const { return {scaled(box.lower), scaled(box.upper)}; }

private:
    /// Beyond the limit neighbouring floats are farther apart than the scene is long: on an axis
    /// with such a coordinate all are equal, and stay so.
    float scaled(float coordinate) const {
        constexpr double limit = 0x1p30;
        return float(std::clamp(double(coordinate) * factor_, -limit, limit));
    }
    glm::vec3 scaled(const glm::vec3& point) const {
        return {scaled(point.x), scaled(point.y), scaled(point.z)};
    }

    double factor_ = 1.0;
};

/// The roots of the subtrees built so far, in the order of the Morton curve.
struct Row {
    std::uint32_t count;
    ClusterBoxes boxes;
    Array<std::uint32_t> nodes;

    explicit Row(std::uint32_t size)
        : count(size), boxes(ClusterBoxes::with_room_for(size)), nodes(size) {}

    std::size_t block_count() const { return (count + block_size - 1) / block_size; }
};

/// Merges clusters until one is left. Interior nodes are numbered downwards from iteration to
/// iteration, so that the last becomes 0, and along the row within one.
class Agglomeration {
public:
    Agglomeration(const Mesh& mesh, Token& token)
        : token_(token),
          bvh_(BinaryBvh::with_references(mesh.size())),
          row_(std::uint32_t(mesh.size())),
          next_row_(std::uint32_t(mesh.size())),
          nearest_(mesh.size()) {
        MortonOrder order = morton_order(mesh, token);
        bvh_.references = std::move(order.references);
        const UnitScale unit_scale(mesh.bounds);
        parallel_for_each(mesh.size(), block_size, token, [&](std::size_t i) {
            const Box& box = order.boxes[bvh_.references[i]];
            row_.nodes[i] = std::uint32_t(bvh_.first_leaf() + i);
            bvh_.boxes[row_.nodes[i]] = box;
            row_.boxes.set(i, unit_scale(box));
        });
    }

    BinaryBvh run(const PlocConfig& config) {
        const double most = config.radius;
        double radius = std::min(double(config.first_radius), most);
        while (row_.count > 1) {
            token_.advance(0.9F - 0.6F * float(row_.count) / float(nearest_.size()));
            find_all_nearest(std::uint32_t(radius));
            merge();
            radius = std::min(radius * config.growth, most);
        }
        return std::move(bvh_);
    }

private:
    /// Clusters that precede a block of the row, or all: those that merge, by the part they play.
    struct Merged {
        std::uint32_t first = 0;   ///< the pair's first: their union takes its place
        std::uint32_t second = 0;  ///< the pair's second: its place goes
    };

    void find_all_nearest(std::uint32_t radius) {
        for_blocks([&](std::size_t, std::uint32_t begin, std::uint32_t end) {
            find_nearest(row_.boxes, row_.count, radius, begin, end, nearest_.data());
        });
    }

    bool is_mutual(std::uint32_t i) const { return nearest_[nearest_[i]] == i; }

    /// The cluster that i merges with. The lowest of equals being the nearest, there is a mutual
    /// pair in every row: of all pairs of least area, the first cluster in any and its nearest.
    /// But with many equals, or triangles that grow along the curve, that can be the only one, and
    /// time would be quadratic; so in a stalled row every two neighbours merge that are left over.
    std::uint32_t partner(std::uint32_t i) const {
        if (is_mutual(i)) return nearest_[i];
        const std::uint32_t neighbour = i ^ 1;
        const bool merges = stalled_ && neighbour < row_.count && !is_mutual(neighbour);
        return merges ? neighbour : no_partner;
    }

    /// Merges pairs and closes the gaps, keeping the order (the compaction step).
    void merge() {
        stalled_ = false;
        std::vector<Merged> before(row_.block_count());
        Merged all = count_merged(before);
        if (row_.count > longest_stalled_row && all.first < stalled_share * row_.count) {
            stalled_ = true;
            all = count_merged(before);
        }
        next_row_.count = row_.count - all.second;
        for_blocks([&](std::size_t block, std::uint32_t begin, std::uint32_t end) {
            merge_block(before[block], begin, end);
        });
        std::swap(row_, next_row_);
    }

    /// Fills `before` by block and returns the sums over the row.
    Merged count_merged(std::vector<Merged>& before) {
        for_blocks([&](std::size_t block, std::uint32_t begin, std::uint32_t end) {
            Merged merged;
            for (std::uint32_t i = begin; i < end; ++i) {
                const std::uint32_t other = partner(i);
                if (other == no_partner) continue;
                ++(i < other ? merged.first : merged.second);
            }
            before[block] = merged;
        });
        Merged all;
        for (Merged& block : before) {
            const Merged merged = std::exchange(block, all);
            all.first += merged.first;
            all.second += merged.second;
        }
        return all;
    }

    void merge_block(Merged merged, std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end; ++i) {
            const std::uint32_t other = partner(i), place = i - merged.second;
            if (other == no_partner) {
                next_row_.nodes[place] = row_.nodes[i];
                next_row_.boxes.set(place, row_.boxes[i]);
            } else if (i < other) {
                const std::uint32_t node = next_row_.count - 1 + merged.first++;
                const std::uint32_t left = row_.nodes[i], right = row_.nodes[other];
                bvh_.children[node] = {left, right};
                bvh_.boxes[node] = unite(bvh_.boxes[left], bvh_.boxes[right]);
                next_row_.nodes[place] = node;
                next_row_.boxes.set(place, unite(row_.boxes[i], row_.boxes[other]));
            } else {
                ++merged.second;
            }
        }
    }

    /// Calls `body(block, begin, end)` for each block of the row.
    template <class Body>
    void for_blocks(Body&& body) {
        parallel_for_each(row_.block_count(), 1, token_, [&](std::size_t block) {
            const std::uint32_t begin = std::uint32_t(block) * block_size;
            body(block, begin, std::min(row_.count, begin + block_size));
        });
    }

    Token& token_;
    BinaryBvh bvh_;
    Row row_, next_row_;
    Array<std::uint32_t> nearest_;  // by place in the row
    bool stalled_ = false;
};

}  // namespace

PlocConfig ploc_config(const Parameters& parameters) {
    return {int(parameters.at("radius")), int(parameters.at("first_radius")),
            parameters.at("growth")};
}

BinaryBvh build_ploc(const Mesh& mesh, const PlocConfig& config, Token& token) {
    token.begin("building PLOC");
    const BinaryBvh bvh = Agglomeration(mesh, token).run(config);
    BinaryBvh ordered = depth_first(bvh, token);
    token.advance(1.0F);
    return ordered;
}

}  // namespace bvhlab
