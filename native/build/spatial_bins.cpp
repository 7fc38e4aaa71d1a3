// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/spatial_bins.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <limits>

#include "build/chunks.h"
#include "build/object_split.h"
#include "build/outline.h"

namespace bvhlab {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

/// The corners of a triangle in ascending order of position, and the inverse lengths of the edges
/// 0-1, 1-2 and 0-2: 0 for edges too steep to be lines.
struct Profile {
    double positions[3], inverses[3];

    void measure() {
        constexpr double steepest = 1e-6;
        const double lengths[3] = {positions[1] - positions[0], positions[2] - positions[1],
                                   positions[2] - positions[0]};
        for (int i = 0; i < 3; ++i) inverses[i] = lengths[i] > steepest ? 1.0 / lengths[i] : 0.0;
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

/// Box of one side of a plane so far, the bins' own axis last.
struct Side {
    float lower[3] = {infinity, infinity, infinity};
    float upper[3] = {-infinity, -infinity, -infinity};

    void grow(int axis, float low, float high) {
        lower[axis] = std::min(lower[axis], low);
        upper[axis] = std::max(upper[axis], high);
    }

    double half_area() const {
        const double x = double(upper[0]) - double(lower[0]);
        const double y = double(upper[1]) - double(lower[1]);
        const double z = double(upper[2]) - double(lower[2]);
        return x * y + z * (x + y);
    }
};

}  // namespace

void SpatialBins::begin(const Box& node, int axis, int bin_count) {
    axis_ = axis;
    bin_count_ = bin_count;
    lower_ = node.lower[axis];
    width_ = (double(node.upper[axis]) - lower_) / bin_count;
    scale_ = 1.0 / width_;
    std::fill_n(begin_here_.begin(), bin_count, RunningBox(Box::empty()));
    std::fill_n(end_here_.begin(), bin_count, RunningBox(Box::empty()));
    std::fill_n(enter_.begin(), bin_count, 0U);
    std::fill_n(exit_.begin(), bin_count, 0U);
}

double SpatialBins::position(float coordinate) const {
    return (double(coordinate) - lower_) * scale_;
}

int SpatialBins::bin_of(float coordinate) const {
    return std::clamp(int(position(coordinate)), 0, bin_count_ - 1);
}

SpatialBins::Range SpatialBins::bins_of(const Reference& reference) const {
    if (reference.splittable == 0) {
        const int bin = bin_of(0.5F * doubled_centre(reference, axis_));
        return {bin, bin};
    }
    return {bin_of(reference.box.lower[axis_]), bin_of(reference.box.upper[axis_])};
}

float SpatialBins::plane_below(int bin) const {
    return float(lower_ + width_ * bin);
}

void SpatialBins::count(const Reference& reference) {
    const auto [first, last] = bins_of(reference);
    begin_here_[std::size_t(first)].grow(reference);
    end_here_[std::size_t(last)].grow(reference);
    ++enter_[std::size_t(first)];
    ++exit_[std::size_t(last)];
}

void SpatialBins::merge_counts(const SpatialBins& other) {
    for (std::size_t bin = 0; bin < std::size_t(bin_count_); ++bin) {
        begin_here_[bin].grow(other.begin_here_[bin]);
        end_here_[bin].grow(other.end_here_[bin]);
        enter_[bin] += other.enter_[bin];
        exit_[bin] += other.exit_[bin];
    }
}

bool SpatialBins::find_planes(std::size_t count, std::size_t budget, double limit) {
    // Backwards: least costs of the right sides, down to where these alone are too much.
    std::array<double, most_spatial_bins> right_costs;
    RunningBox right(Box::empty());
    std::size_t whole = 0, right_count = 0;
    int lowest = bin_count_ - 1;
    for (; lowest > 0; --lowest) {
        const auto bin = std::size_t(lowest);
        right.grow(begin_here_[bin]);
        whole += enter_[bin];
        right_count += exit_[bin];
        right_costs[bin] = whole > 0 ? right.half_area() * double(right_count) : 0.0;
        if (right_costs[bin] >= limit) break;
    }

    // Forwards: left sides, up to where these alone are too much.
    RunningBox left(Box::empty());
    std::size_t left_count = 0;
    whole = 0;
    planes_ = {most_spatial_bins, 0};
    for (int plane = 1; plane < bin_count_; ++plane) {
        const auto below = std::size_t(plane) - 1;
        left.grow(end_here_[below]);
        whole += exit_[below];
        left_count += enter_[below];
        if (plane <= lowest) continue;
        const double left_cost = whole > 0 ? left.half_area() * double(left_count) : 0.0;
        if (left_cost >= limit) break;
        if (left_count == 0 || whole == count || left_count - whole > budget) continue;
        if (left_cost + right_costs[std::size_t(plane)] >= limit) continue;
        planes_ = {std::min(planes_.first, plane), plane};
    }
    if (planes_.last == 0) return false;
    ready_rows();
    return true;
}

/// Empties the rows, but for whole references below the first and above the last plane.
void SpatialBins::ready_rows() {
    const auto rows = std::size_t(planes_.last - planes_.first) + 2;
    RunningBox below(Box::empty()), above(Box::empty());
    for (int bin = 0; bin < planes_.first; ++bin) below.grow(end_here_[std::size_t(bin)]);
    for (int bin = planes_.last; bin < bin_count_; ++bin) above.grow(begin_here_[std::size_t(bin)]);
    for (int i = 0; i < 2; ++i) {
        auto& lowers = lowers_[std::size_t(i)];
        auto& uppers = uppers_[std::size_t(i)];
        std::fill_n(lowers.begin(), rows, infinity);
        std::fill_n(uppers.begin(), rows, -infinity);
        lowers[0] = below.lower(other_axis(i));
        uppers[0] = below.upper(other_axis(i));
        lowers[rows - 1] = above.lower(other_axis(i));
        uppers[rows - 1] = above.upper(other_axis(i));
    }
}

void SpatialBins::grow(int bin, int i, float lower, float upper) {
    const auto row = std::size_t(bin - (planes_.first - 1));
    float& bin_lower = lowers_[std::size_t(i)][row];
    float& bin_upper = uppers_[std::size_t(i)][row];
    bin_lower = std::min(bin_lower, lower);
    bin_upper = std::max(bin_upper, upper);
}

void SpatialBins::add(const Reference& reference, const Mesh& mesh) {
    const auto [first, last] = bins_of(reference);
    if (last < planes_.first || first >= planes_.last) return;  // ready_rows has added it
    if (first < last) {
        chop(reference, mesh.triangle(reference.triangle),
             {std::max(first, planes_.first - 1), std::min(last, planes_.last)});
        return;
    }
    for (int i = 0; i < 2; ++i)
        grow(first, i, reference.box.lower[other_axis(i)], reference.box.upper[other_axis(i)]);
}

void SpatialBins::chop(const Reference& reference, const Triangle& triangle, Range bins) {
    // Corners in ascending order on the axis, without branches that could not be predicted.
    const glm::vec3 corners[3] = {triangle.a, triangle.b, triangle.c};
    const float a = corners[0][axis_], b = corners[1][axis_], c = corners[2][axis_];
    int order[3];
    order[(a > b) + (a > c)] = 0;
    order[(a <= b) + (b > c)] = 1;
    order[(a <= c) + (b <= c)] = 2;
    Profile profile;
    for (int i = 0; i < 3; ++i)
        profile.positions[i] = position(corners[order[i]][axis_]) - bins.first;
    profile.measure();

    const Box& box = reference.box;
    Part part{float(position(box.lower[axis_]) - bins.first),
              float(position(box.upper[axis_]) - bins.first), 0.0F, 0.0F};
    const glm::vec3& middle = corners[order[1]];
    const bool has_middle = middle[axis_] >= box.lower[axis_] && middle[axis_] <= box.upper[axis_];
    const auto row = std::size_t(bins.first - (planes_.first - 1));
    for (int i = 0; i < 2; ++i) {
        const int axis = other_axis(i);
        part.lowest = box.lower[axis];
        part.highest = box.upper[axis];
        const Outline outline =
            profile.outline(corners[order[0]][axis], middle[axis], corners[order[2]][axis]);
        grow_bins(outline, part, bins.last - bins.first + 1, lowers_[std::size_t(i)].data() + row,
                  uppers_[std::size_t(i)].data() + row);
        if (has_middle) {
            const float corner = std::clamp(middle[axis], part.lowest, part.highest);
            grow(std::clamp(bin_of(middle[axis_]), bins.first, bins.last), i, corner, corner);
        }
    }
}

void SpatialBins::merge_parts(const SpatialBins& other) {
    for (int bin = planes_.first - 1; bin <= planes_.last; ++bin) {
        const auto row = std::size_t(bin - (planes_.first - 1));
        for (std::size_t i = 0; i < 2; ++i)
            grow(bin, int(i), other.lowers_[i][row], other.uppers_[i][row]);
    }
}

void SpatialBins::find_split(std::size_t count, std::size_t budget, SpatialSplit& best) const {
    const auto row_of = [&](int bin) { return std::size_t(bin - (planes_.first - 1)); };
    const auto own_lower = [&](int bin) { return begin_here_[std::size_t(bin)].lower(axis_); };
    const auto own_upper = [&](int bin) { return end_here_[std::size_t(bin)].upper(axis_); };

    // Backwards: costs of the right sides. One that holds cut references begins at the plane.
    std::array<double, most_spatial_bins> right_costs;
    Side right;
    std::size_t right_count = 0, whole = 0;
    for (int plane = bin_count_ - 1; plane >= planes_.first; --plane) {
        right.grow(2, own_lower(plane), own_upper(plane));
        right_count += exit_[std::size_t(plane)];
        whole += enter_[std::size_t(plane)];
        if (plane > planes_.last) continue;
        for (int i = 0; i < 2; ++i)
            right.grow(i, lowers_[std::size_t(i)][row_of(plane)],
                       uppers_[std::size_t(i)][row_of(plane)]);
        Side side = right;
        if (right_count > whole) side.grow(2, plane_below(plane), -infinity);
        right_costs[std::size_t(plane)] = side.half_area() * double(right_count);
    }

    // Forwards: left sides.
    Side left;
    std::size_t left_count = 0;
    whole = 0;
    for (int plane = 1; plane <= planes_.last; ++plane) {
        left.grow(2, own_lower(plane - 1), own_upper(plane - 1));
        left_count += enter_[std::size_t(plane) - 1];
        whole += exit_[std::size_t(plane) - 1];
        if (plane < planes_.first) continue;
        for (int i = 0; i < 2; ++i)
            left.grow(i, lowers_[std::size_t(i)][row_of(plane - 1)],
                      uppers_[std::size_t(i)][row_of(plane - 1)]);
        const std::size_t duplicates = left_count - whole;
        if (left_count == 0 || whole == count || duplicates > budget) continue;
        Side side = left;
        if (duplicates > 0) side.grow(2, infinity, plane_below(plane));
        const double cost = side.half_area() * double(left_count) + right_costs[std::size_t(plane)];
        if (cost < best.cost) best = {cost, axis_, plane_below(plane)};
    }
}

namespace {

/// Calls `visit(part, reference)` for all references with bins of the thread's own, copies of
/// `bins`, and `merge(part)` for each of these in the end.
template <class Visit, class Merge>
void visit_in_parallel(const ReferenceView& node, const SpatialBins& bins, const Token& token,
                       Visit&& visit, Merge&& merge) {
    tbb::enumerable_thread_specific<SpatialBins> parts(bins);
    for_chunks(node.size(), token, [&](std::size_t begin, std::size_t end) {
        SpatialBins& part = parts.local();
        for (std::size_t i = begin; i < end; ++i) visit(part, node.references[i]);
    });
    for (const SpatialBins& part : parts) merge(part);
}

}  // namespace

SpatialSplit find_spatial_split(const ReferenceView& node, const Box& bounds, const Mesh& mesh,
                                int bin_count, std::size_t budget, double limit, SpatialBins& bins,
                                const Token& token) {
    SpatialSplit best{limit};
    const auto count = [](SpatialBins& part, const Reference& r) { part.count(r); };
    const auto add = [&](SpatialBins& part, const Reference& r) { part.add(r, mesh); };
    const bool is_large = node.size() > chunk_size;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(bounds.upper[axis] > bounds.lower[axis])) continue;
        bins.begin(bounds, axis, bin_count);
        if (is_large)
            visit_in_parallel(node, bins, token, count,
                              [&](const SpatialBins& part) { bins.merge_counts(part); });
        else
            for (const Reference& reference : node.references) bins.count(reference);
        if (!bins.find_planes(node.size(), budget, best.cost)) continue;
        if (is_large)
            visit_in_parallel(node, bins, token, add,
                              [&](const SpatialBins& part) { bins.merge_parts(part); });
        else
            for (const Reference& reference : node.references) bins.add(reference, mesh);
        bins.find_split(node.size(), budget, best);
    }
    return best;
}

}  // namespace bvhlab
