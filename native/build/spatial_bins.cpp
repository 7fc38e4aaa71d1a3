// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/spatial_bins.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <utility>

#include "build/chunks.h"
#include "build/object_split.h"
#include "build/outline.h"

namespace bvhlab {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

/// The corners of a triangle in ascending order of position.
struct Profile {
    double positions[3];
    double inverses[3];  ///< of the lengths of edges 0-1, 1-2, 0-2; 0 for edges too steep to be lines

    void measure() {
        constexpr double steepest = 1e-6;
        const double lengths[3] = {positions[1] - positions[0], positions[2] - positions[1],
                                   positions[2] - positions[0]};
        for (int i = 0; i < 3; ++i)
            inverses[i] = lengths[i] > steepest ? 1.0 / lengths[i] : 0.0;
    }

    Line line(int edge, int corner, double a, double b) const {
        const double step = (b - a) * inverses[edge];
        return {float(a - positions[corner] * step), float(step)};
    }

    /// `a`, `b`, `c` are the corners' values on the axis that is looked at.
    Outline outline(double a, double b, double c) const {
        if (inverses[2] == 0.0) {
            const Line lowest{float(std::min({a, b, c})), 0.0F};
            const Line highest{float(std::max({a, b, c})), 0.0F};
            return {{lowest, lowest}, {highest, highest}};
        }
        const Line whole = line(2, 0, a, c);
        Line before = line(0, 0, a, b), after = line(1, 1, b, c);
        if (inverses[0] == 0.0) before = after;
        if (inverses[1] == 0.0) after = before;
        const bool middle_is_above = b > a + (positions[1] - positions[0]) * (c - a) * inverses[2];
        if (middle_is_above) return {{whole, whole}, {before, after}};
        return {{before, after}, {whole, whole}};
    }
};

}  // namespace

void SpatialBins::begin(const Box& node, int axis, int bin_count) {
    axis_ = axis;
    bin_count_ = bin_count;
    lower_ = node.lower[axis];
    width_ = (double(node.upper[axis]) - lower_) / bin_count;
    scale_ = 1.0 / width_;
    for (Row& row : lowers_) std::fill_n(row.begin(), bin_count, infinity);
    for (Row& row : uppers_) std::fill_n(row.begin(), bin_count, -infinity);
    std::fill_n(enter_.begin(), bin_count, 0U);
    std::fill_n(exit_.begin(), bin_count, 0U);
}

double SpatialBins::position(float coordinate) const {
    return (double(coordinate) - lower_) * scale_;
}

int SpatialBins::bin_of(float coordinate) const {
    return int(std::clamp(position(coordinate), 0.0, double(bin_count_ - 1)));
}

float SpatialBins::plane_below(int bin) const { return float(lower_ + width_ * bin); }

void SpatialBins::grow(int bin, int axis, float lower, float upper) {
    float& bin_lower = lowers_[std::size_t(axis)][std::size_t(bin)];
    float& bin_upper = uppers_[std::size_t(axis)][std::size_t(bin)];
    bin_lower = std::min(lower, bin_lower);
    bin_upper = std::max(upper, bin_upper);
}

void SpatialBins::add(const Reference& reference, const Mesh& mesh) {
    const Box& box = reference.box;
    int first = bin_of(box.lower[axis_]), last = bin_of(box.upper[axis_]);
    if (reference.splittable == 0) first = last = bin_of(0.5F * doubled_centre(reference, axis_));
    grow(first, axis_, box.lower[axis_], -infinity);
    grow(last, axis_, infinity, box.upper[axis_]);
    ++enter_[std::size_t(first)];
    ++exit_[std::size_t(last)];
    if (first < last) {
        chop(reference, mesh.triangle(reference.triangle), first, last);
        return;
    }
    for (const int axis : {(axis_ + 1) % 3, (axis_ + 2) % 3})
        grow(first, axis, box.lower[axis], box.upper[axis]);
}

void SpatialBins::chop(const Reference& reference, const Triangle& triangle, int first,
                       int last) {
    // Corners in ascending order on the axis, without branches that could not be predicted.
    const glm::vec3 corners[3] = {triangle.a, triangle.b, triangle.c};
    const float a = corners[0][axis_], b = corners[1][axis_], c = corners[2][axis_];
    int order[3];
    order[(a > b) + (a > c)] = 0;
    order[(a <= b) + (b > c)] = 1;
    order[(a <= c) + (b <= c)] = 2;
    Profile profile;
    for (int i = 0; i < 3; ++i) profile.positions[i] = position(corners[order[i]][axis_]) - first;
    profile.measure();

    const Box& box = reference.box;
    Part part{float(position(box.lower[axis_]) - first), float(position(box.upper[axis_]) - first),
              0.0F, 0.0F};
    const glm::vec3& middle = corners[order[1]];
    const bool has_middle = middle[axis_] >= box.lower[axis_] && middle[axis_] <= box.upper[axis_];
    for (const int axis : {(axis_ + 1) % 3, (axis_ + 2) % 3}) {
        part.lowest = box.lower[axis];
        part.highest = box.upper[axis];
        const Outline outline = profile.outline(corners[order[0]][axis], middle[axis],
                                                corners[order[2]][axis]);
        grow_bins(outline, part, last - first + 1, lowers_[std::size_t(axis)].data() + first,
                  uppers_[std::size_t(axis)].data() + first);
        if (has_middle) {
            const float corner = std::clamp(middle[axis], part.lowest, part.highest);
            grow(bin_of(middle[axis_]), axis, corner, corner);
        }
    }
}

void SpatialBins::merge(const SpatialBins& other) {
    for (std::size_t bin = 0; bin < std::size_t(bin_count_); ++bin) {
        for (std::size_t axis = 0; axis < 3; ++axis)
            grow(int(bin), int(axis), other.lowers_[axis][bin], other.uppers_[axis][bin]);
        enter_[bin] += other.enter_[bin];
        exit_[bin] += other.exit_[bin];
    }
}

void SpatialBins::find_split(std::size_t count, std::size_t budget, SpatialSplit& best) const {
    const auto box_of = [&](std::size_t bin) {
        return Box{{lowers_[0][bin], lowers_[1][bin], lowers_[2][bin]},
                   {uppers_[0][bin], uppers_[1][bin], uppers_[2][bin]}};
    };
    const auto bins = std::size_t(bin_count_);

    // Backwards: costs of the right sides, down to where these alone are too much. A side that holds cut references
    // begins at the plane.
    std::array<double, most_spatial_bins> right_costs;
    Box right = Box::empty();
    std::size_t right_count = 0, right_entered = 0, lowest = bins - 1;
    for (; lowest > 0; --lowest) {
        right.grow(box_of(lowest));
        right_count += exit_[lowest];
        right_entered += enter_[lowest];
        Box side = right;
        if (right_count > right_entered)
            side.lower[axis_] = std::min(plane_below(int(lowest)), side.lower[axis_]);
        right_costs[lowest] = side.half_area() * double(right_count);
        if (right_costs[lowest] >= best.cost) break;
    }

    // Forwards: left sides, up to where these alone are too much.
    Box left = Box::empty();
    std::size_t left_count = 0;
    right_count = count;
    for (std::size_t bin = 0; bin + 1 < bins; ++bin) {
        left.grow(box_of(bin));
        left_count += enter_[bin];
        right_count -= exit_[bin];
        if (bin < lowest) continue;
        const std::size_t duplicates = left_count + right_count - count;
        const float plane = plane_below(int(bin) + 1);
        Box side = left;
        if (duplicates > 0) side.upper[axis_] = std::max(plane, side.upper[axis_]);
        const double left_cost = side.half_area() * double(left_count);
        if (left_cost >= best.cost) return;
        const double cost = left_cost + right_costs[bin + 1];
        if (cost < best.cost && left_count > 0 && right_count > 0 && duplicates <= budget)
            best = {cost, axis_, plane};
    }
}

SpatialSplit find_spatial_split(const ReferenceView& node, const Box& bounds, const Mesh& mesh,
                                int bin_count, std::size_t budget, double limit,
                                SpatialBins& bins, const Token& token) {
    SpatialSplit best{limit};
    for (int axis = 0; axis < 3; ++axis) {
        if (!(bounds.upper[axis] > bounds.lower[axis])) continue;
        bins.begin(bounds, axis, bin_count);
        if (node.size() <= chunk_size) {
            for (const Reference& reference : node.references) bins.add(reference, mesh);
        } else {
            tbb::enumerable_thread_specific<SpatialBins> parts(bins);
            for_chunks(node.size(), token, [&](std::size_t begin, std::size_t end) {
                SpatialBins& part = parts.local();
                for (std::size_t i = begin; i < end; ++i) part.add(node.references[i], mesh);
            });
            for (const SpatialBins& part : parts) bins.merge(part);
        }
        bins.find_split(node.size(), budget, best);
    }
    return best;
}

}  // namespace bvhlab
