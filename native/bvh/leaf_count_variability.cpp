// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/leaf_count_variability.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/vec3.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "bvh/subtrees.h"

namespace bvhlab {
namespace {

/// Uniform number in [0, 1) of a counter: the SplitMix64 sequence (Steele, Lea, Flood 2014), whose
/// state is the counter itself.
double random_number(std::uint64_t counter) {
    std::uint64_t z = (counter + 1) * 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return double((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/// A whole line: origin + t direction for every t.
class Line {
public:
    Line(const glm::dvec3& origin, const glm::dvec3& direction) : origin_(origin) {
        for (int axis = 0; axis < 3; ++axis) {
            // Keep 0 times infinity out: so small a slope changes no float.
            const double slope = direction[axis];
            inverse_[axis] = 1.0 / (std::abs(slope) < 1e-200 ? 1e-200 : slope);
            near_[axis] = inverse_[axis] < 0.0 ? 1 : 0;
        }
    }

    /// Whether the line meets a closed box, given by planes[2 * axis + (0 lower, 1 upper)]. Never
    /// an empty one, and each box that contains one that it meets: rounding is monotonic.
    template <class Planes>
    bool meets(const Planes& planes) const {
        double enter = -std::numeric_limits<double>::infinity(), leave = -enter;
        for (int axis = 0; axis < 3; ++axis) {
            const int first = 2 * axis + near_[axis], last = 2 * axis + 1 - near_[axis];
            enter = std::max(enter, (double(planes(first)) - origin_[axis]) * inverse_[axis]);
            leave = std::min(leave, (double(planes(last)) - origin_[axis]) * inverse_[axis]);
        }
        return enter <= leave;
    }

    bool meets(const Box& box) const {
        return meets([&](int plane) { return (plane % 2 ? box.upper : box.lower)[plane / 2]; });
    }

    template <unsigned K>
    bool meets(const WideNode<K>& node, unsigned child) const {
        return meets([&](int plane) { return node.planes[plane][child]; });
    }

private:
    glm::dvec3 origin_, inverse_;
    int near_[3];
};

/// Line number `index` through a box with area.
Line random_line(const Box& box, std::uint64_t index) {
    constexpr unsigned numbers = 5;  // per line
    const auto random = [&](unsigned i) { return random_number(numbers * index + i); };
    const glm::dvec3 lower(box.lower), size = glm::dvec3(box.upper) - lower;

    // A uniform point on the surface: an axis by its faces' area, one of the two faces, a point.
    const double faces[3] = {size.y * size.z, size.z * size.x, size.x * size.y};
    double choice = random(0) * (faces[0] + faces[1] + faces[2]);
    int axis = 0;
    while (axis < 2 && choice >= faces[axis]) choice -= faces[axis++];
    while (faces[axis] <= 0.0) --axis;  // rounding led past the last face with area
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const bool upper = choice >= 0.5 * faces[axis];
    glm::dvec3 origin = lower;
    origin[axis] += upper ? size[axis] : 0.0;
    origin[u] += random(1) * size[u];
    origin[v] += random(2) * size[v];

    // A cosine-weighted direction: a uniform point of the disc, lifted to the hemisphere.
    const double radius = std::sqrt(random(3)), angle = 2.0 * std::numbers::pi * random(4);
    glm::dvec3 direction(0.0);
    direction[axis] = (upper ? -1.0 : 1.0) * std::sqrt(1.0 - radius * radius);
    direction[u] = radius * std::cos(angle);
    direction[v] = radius * std::sin(angle);
    return {origin, direction};
}

/// Leaves whose box the line meets. `pending` is working memory.
template <class Tree>
std::uint32_t count_leaves(const Tree& wide, const Subtrees& below, const Line& line,
                           std::vector<std::uint32_t>& pending, const Token& token) {
    constexpr unsigned k = Tree::branching;
    std::uint32_t count = 0, visits = 0;
    pending.assign(1, 0);
    while (!pending.empty()) {
        if (++visits % 4096 == 0) token.check();
        const WideNode<k>& node = wide.node(pending.back());
        pending.pop_back();
        for (unsigned i = 0; i < k && !node.is_missing(i); ++i) {
            if (!line.meets(node, i)) continue;
            const std::uint32_t child = node.child[i];
            if (node.is_leaf(i))
                ++count;
            else if (line.meets(below.common[child]))
                count += below.leaves[child];
            else
                pending.push_back(child);
        }
    }
    return count;
}

/// Mean, standard deviation and, from the fourth moment, its standard error:
/// var(s^2) = (m4 - s^4) / n for large n, and s = sqrt(s^2).
LeafCounts moments(const std::vector<std::uint32_t>& counts) {
    const auto n = double(counts.size());
    double sum = 0.0, second = 0.0, fourth = 0.0;
    for (const std::uint32_t count : counts) sum += double(count);
    const double mean = sum / n;
    for (const std::uint32_t count : counts) {
        const double square = (double(count) - mean) * (double(count) - mean);
        second += square;
        fourth += square * square;
    }
    const double variance = second / (n - 1.0);
    if (variance <= 0.0) return {mean, 0.0, 0.0};
    const double spread = std::max(0.0, fourth / n - variance * variance);
    return {mean, std::sqrt(variance), std::sqrt(spread / n / variance) / 2.0};
}

template <class Tree>
LeafCounts variability_of(const Tree& wide, std::size_t lines, Token& token) {
    constexpr unsigned k = Tree::branching;
    const WideNode<k>& root = wide.node(0);
    Box scene = Box::empty();
    for (unsigned i = 0; i < k; ++i) scene.grow(root.box(i));
    if (!(scene.half_area() > 0.0)) return {};

    const Subtrees below = find_subtrees(wide, CostModel{}, token);
    std::vector<std::uint32_t> counts(lines);
    std::atomic<std::size_t> done = 0;
    constexpr std::size_t grain = 64;
    const auto count = [&](const IndexRange& range) {
        token.check();
        std::vector<std::uint32_t> pending;
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            counts[i] = count_leaves(wide, below, random_line(scene, i), pending, token);
        token.advance(float(done += range.size()) / float(lines));
    };
    // Not more than `grain` lines to a task, so that a cancel is seen soon.
    parallel_for_ranges(0, lines, grain, count);
    return moments(counts);
}

}  // namespace

LeafCounts leaf_count_variability(const Bvh& bvh, std::size_t lines, Token& token) {
    token.begin("measuring leaf-count variability");
    const LeafCounts counts =
        std::visit([&](const auto& wide) { return variability_of(wide, lines, token); }, bvh.tree);
    token.advance(1.0F);
    return counts;
}

}  // namespace bvhlab
