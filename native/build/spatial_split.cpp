// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/spatial_split.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "build/chunks.h"
#include "build/clip.h"
#include "build/object_split.h"

namespace bvhlab {
namespace {

using Side = SpatialDivision::Side;

/// What one side of the plane holds so far.
struct Half {
    Box box = Box::empty();
    std::size_t count = 0;

    void add(const Box& reference) {
        box.grow(reference);
        ++count;
    }
    double cost() const { return box.half_area() * double(count); }
    double cost_with(const Box& reference) const {
        return unite(box, reference).half_area() * double(count + 1);
    }
};

struct Halves {
    Half left, right;
};

/// Puts the references beside the plane on their side.
Halves divide_uncut(const ReferenceView& node, const SpatialSplit& split, Array<Side>& sides,
                    const Token& token) {
    sides.resize(node.size());
    std::vector<Halves> parts(chunk_count(node.size()));
    for_chunks(node.size(), token, [&](std::size_t begin, std::size_t end) {
        Halves& halves = parts[begin / chunk_size];
        for (std::size_t i = begin; i < end; ++i) {
            const Box& box = node.references[i].box;
            if (box.upper[split.axis] <= split.plane) {
                halves.left.add(box);
                sides[i] = Side::left_side;
            } else if (box.lower[split.axis] >= split.plane) {
                halves.right.add(box);
                sides[i] = Side::right_side;
            } else {
                sides[i] = Side::undecided;
            }
        }
    });
    Halves all;
    for (const Halves& part : parts) {
        all.left.box.grow(part.left.box);
        all.right.box.grow(part.right.box);
        all.left.count += part.left.count;
        all.right.count += part.right.count;
    }
    return all;
}

/// The cheapest side for a reference with the given parts. Equal costs: left, then right, then
/// both. An empty part leaves no choice; the reference stays whole, so nothing of it is lost.
Side cheapest_side(const Halves& halves, const Reference& reference, const CutBoxes& parts,
                   bool may_cut) {
    if (parts.right.is_empty()) return Side::left_side;
    if (parts.left.is_empty()) return Side::right_side;
    const double left = halves.left.cost_with(reference.box) + halves.right.cost();
    const double right = halves.left.cost() + halves.right.cost_with(reference.box);
    if (may_cut) {
        const double both = halves.left.cost_with(parts.left) + halves.right.cost_with(parts.right);
        if (both < std::min(left, right)) return Side::both_sides;
    }
    return left <= right ? Side::left_side : Side::right_side;
}

/// Writes one side's order: positions of references that stay whole, given in order, with the parts
/// merged in.
class OrderMerger {
public:
    OrderMerger(std::span<std::uint32_t> target, std::span<const Reference> parts, int axis)
        : target_(target),
          parts_(parts),
          axis_(axis),
          first_part_(std::uint32_t(target.size() - parts.size())),
          sorted_(parts.size()) {
        std::iota(sorted_.begin(), sorted_.end(), 0U);
        std::ranges::stable_sort(sorted_, {}, [&](std::uint32_t part) { return centre(part); });
    }

    void add(std::uint32_t position, const Reference& reference) {
        if (next_ < sorted_.size()) {
            const float limit = doubled_centre(reference, axis_);
            while (next_ < sorted_.size() && centre(sorted_[next_]) < limit) add_part();
        }
        target_[size_++] = position;
    }

    void finish() {
        while (next_ < sorted_.size()) add_part();
    }

private:
    float centre(std::uint32_t part) const { return doubled_centre(parts_[part], axis_); }
    void add_part() { target_[size_++] = first_part_ + sorted_[next_++]; }

    std::span<std::uint32_t> target_;
    std::span<const Reference> parts_;
    int axis_;
    std::uint32_t first_part_;
    std::vector<std::uint32_t> sorted_;
    std::size_t next_ = 0, size_ = 0;
};

void divide_order(const ReferenceView& node, const SpatialDivision& division, int axis,
                  const Array<std::uint32_t>& ranks, const ReferenceTarget& left,
                  const ReferenceTarget& right, const Token& token) {
    OrderMerger to_left(left.orders[std::size_t(axis)], division.left_parts, axis);
    OrderMerger to_right(right.orders[std::size_t(axis)], division.right_parts, axis);
    std::size_t until_check = chunk_size;
    for (const std::uint32_t position : node.orders[std::size_t(axis)]) {
        if (--until_check == 0) {
            token.check();
            until_check = chunk_size;
        }
        const Side side = division.sides[position];
        if (side == Side::left_side)
            to_left.add(ranks[position], node.references[position]);
        else if (side == Side::right_side)
            to_right.add(ranks[position], node.references[position]);
    }
    to_left.finish();
    to_right.finish();
}

/// Writes the references that stay whole, in list order, and where each went.
void place_uncut(const ReferenceView& node, const SpatialDivision& division,
                 Array<std::uint32_t>& ranks, const ReferenceTarget& left,
                 const ReferenceTarget& right, const Token& token) {
    using Counts = std::array<std::size_t, 2>;
    std::vector<Counts> before(chunk_count(node.size()), Counts{0, 0});
    if (before.size() > 1) {
        for_chunks(node.size(), token, [&](std::size_t begin, std::size_t end) {
            Counts& counts = before[begin / chunk_size];
            for (std::size_t i = begin; i < end; ++i)
                if (division.sides[i] != Side::both_sides) ++counts[division.sides[i]];
        });
        Counts sum{0, 0};
        for (Counts& counts : before)
            for (std::size_t side = 0; side < 2; ++side)
                sum[side] += std::exchange(counts[side], sum[side]);
    }
    const ReferenceTarget* targets[2] = {&left, &right};
    for_chunks(node.size(), token, [&](std::size_t begin, std::size_t end) {
        Counts place = before[begin / chunk_size];
        for (std::size_t i = begin; i < end; ++i) {
            const Side side = division.sides[i];
            if (side == Side::both_sides) continue;
            ranks[i] = std::uint32_t(place[side]);
            targets[side]->references[place[side]++] = node.references[i];
        }
    });
}

}  // namespace

void decide_sides(const ReferenceView& node, const SpatialSplit& split, const Mesh& mesh,
                  std::size_t budget, SpatialDivision& division, const Token& token) {
    Halves halves = divide_uncut(node, split, division.sides, token);
    division.left_parts.clear();
    division.right_parts.clear();
    for (std::size_t i = 0; i < node.size(); ++i) {
        if (i % chunk_size == 0) token.check();
        Side& side = division.sides[i];
        if (side != Side::undecided) continue;
        const Reference& reference = node.references[i];
        const CutBoxes parts =
            cut(reference, mesh.triangle(reference.triangle), split.axis, split.plane);
        const bool may_cut = reference.splittable != 0 && division.duplicates() < budget;
        side = cheapest_side(halves, reference, parts, may_cut);
        if (side == Side::both_sides) {
            halves.left.add(parts.left);
            halves.right.add(parts.right);
            division.left_parts.push_back({parts.left, reference.triangle, 1});
            division.right_parts.push_back({parts.right, reference.triangle, 1});
        } else {
            (side == Side::left_side ? halves.left : halves.right).add(reference.box);
        }
    }
    division.left_size = halves.left.count;
    division.right_size = halves.right.count;
}

void divide_space(const ReferenceView& node, const SpatialDivision& division,
                  Array<std::uint32_t>& ranks, const ReferenceTarget& left,
                  const ReferenceTarget& right, const Token& token) {
    if (ranks.size() < node.size()) ranks.resize(node.size());
    place_uncut(node, division, ranks, left, right, token);
    const auto parts = std::ptrdiff_t(division.duplicates());
    std::ranges::copy(division.left_parts, left.references.end() - parts);
    std::ranges::copy(division.right_parts, right.references.end() - parts);
    if (node.size() <= chunk_size) {
        for (int axis = 0; axis < 3; ++axis)
            divide_order(node, division, axis, ranks, left, right, token);
        return;
    }
    parallel_for_within_task(3, [&](std::size_t axis) {
        divide_order(node, division, int(axis), ranks, left, right, token);
    });
}

}  // namespace bvhlab
