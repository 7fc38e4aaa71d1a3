// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/object_split.h"

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "build/chunks.h"
#include "build/clip.h"
#include "build/radix_sort.h"
#include "build/running_box.h"

namespace bvhlab {
namespace {

using Order = std::span<const std::uint32_t>;

/// Maps floats to integers of the same order; -0 and 0 to the same.
std::uint32_t ordered_bits(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value + 0.0F);
    return bits & 0x80000000U ? ~bits : bits | 0x80000000U;
}

bool all_centres_equal(const ReferenceView& node) {
    for (int axis = 0; axis < 3; ++axis) {
        const Order order = node.orders[std::size_t(axis)];
        if (doubled_centre(node.references[order.front()], axis) !=
            doubled_centre(node.references[order.back()], axis))
            return false;
    }
    return true;
}

/// Asks for the reference that a pass over an order needs a little later: large nodes exceed the
/// caches.
void prefetch(const Reference* references, Order order, std::size_t i) {
    if (i < order.size()) __builtin_prefetch(references + order[i]);
}

constexpr std::size_t prefetch_distance = 16;

Box box_of(std::span<const Reference> references, Order order) {
    RunningBox box(Box::empty());
    for (std::size_t i = 0; i < order.size(); ++i) {
        prefetch(references.data(), order, i + prefetch_distance);
        box.grow(references[order[i]]);
    }
    return box.box();
}

/// The rule of find_object_split: whether `a` is to be taken rather than `b`.
bool is_better(const ObjectSplit& a, const ObjectSplit& b, std::size_t count) {
    if (a.cost != b.cost) return a.cost < b.cost;
    const auto imbalance = [&](const ObjectSplit& split) {
        return std::max(split.left_size, count - split.left_size);
    };
    if (imbalance(a) != imbalance(b)) return imbalance(a) < imbalance(b);
    if (a.axis != b.axis) return a.axis < b.axis;
    return a.left_size < b.left_size;
}

/// A part [begin, end) of an order, with the boxes of what comes before and after it.
struct Stretch {
    std::size_t begin, end;
    Box before, after;
};

/// Improves `best` by the splits behind each reference of one stretch of at most chunk_size
/// references.
void sweep(const ReferenceView& node, int axis, const Stretch& stretch, ObjectSplit& best) {
    const Order order = node.orders[std::size_t(axis)];
    const Reference* references = node.references.data();
    const std::size_t count = node.size();

    // Backwards: costs of the right sides, down to where these alone are too much.
    double right_costs[chunk_size];  // at i: of what comes behind reference stretch.begin + i
    RunningBox right(stretch.after);
    std::size_t first = stretch.end;
    if (first == count) right.grow(references[order[--first]]);
    for (; first > stretch.begin; --first) {
        const double cost = right.half_area() * double(count - first);
        if (cost > best.cost) break;
        right_costs[first - 1 - stretch.begin] = cost;
        prefetch(references, order, first - 1 - prefetch_distance);
        right.grow(references[order[first - 1]]);
    }

    // Forwards: left sides, up to where these alone are too much.
    RunningBox left(stretch.before);
    const std::size_t last = std::min(stretch.end, count - 1);
    for (std::size_t i = stretch.begin; i < last; ++i) {
        left.grow(references[order[i]]);
        if (i < first) continue;
        const double left_cost = left.half_area() * double(i + 1);
        if (left_cost > best.cost) return;
        const double cost = left_cost + right_costs[i - stretch.begin];
        if (cost > best.cost) continue;
        const ObjectSplit split{cost, axis, i + 1};
        if (is_better(split, best, count)) best = split;
    }
}

/// The same on all axes for a node of more than one chunk, in parallel.
ObjectSplit sweep_large(const ReferenceView& node, const Token& token) {
    const std::size_t count = node.size(), chunks = chunk_count(count);
    std::array<std::vector<Stretch>, 3> stretches;
    ObjectSplit best;
    for (int axis = 0; axis < 3; ++axis) {
        const Order order = node.orders[std::size_t(axis)];
        auto& parts = stretches[std::size_t(axis)];
        parts.resize(chunks);

        // Box of each stretch, then of all before and after it.
        for_chunks(count, token, [&](std::size_t begin, std::size_t end) {
            const Box box = box_of(node.references, order.subspan(begin, end - begin));
            parts[begin / chunk_size] = {begin, end, box, box};
        });
        Box before = Box::empty(), after = Box::empty();
        for (std::size_t i = 0; i < chunks; ++i) {
            const Box box = parts[i].before;
            parts[i].before = before;
            before.grow(box);
        }
        for (std::size_t i = chunks; i-- > 0;) {
            const Box box = parts[i].after;
            parts[i].after = after;
            after.grow(box);
        }

        std::vector<ObjectSplit> splits(chunks, best);
        for_chunks(count, token, [&](std::size_t begin, std::size_t) {
            const std::size_t chunk = begin / chunk_size;
            sweep(node, axis, parts[chunk], splits[chunk]);
        });
        for (const ObjectSplit& split : splits)
            if (is_better(split, best, count)) best = split;
    }
    return best;
}

double split_cost(const ReferenceView& node, const ObjectSplit& split, const Token& token) {
    const auto [left, right] = side_boxes(node, split, token);
    return left.half_area() * double(split.left_size) +
           right.half_area() * double(node.size() - split.left_size);
}

/// Divides `order` stably into ranks below `left_size` and the others.
void divide_order(Order order, const Array<std::uint32_t>& ranks, std::uint32_t left_size,
                  std::span<std::uint32_t> left, std::span<std::uint32_t> right,
                  const Token& token) {
    const std::size_t chunks = chunk_count(order.size());
    std::vector<std::size_t> left_before;
    if (chunks > 1) {
        left_before.resize(chunks);
        for_chunks(order.size(), token, [&](std::size_t begin, std::size_t end) {
            std::size_t lefts = 0;
            for (std::size_t i = begin; i < end; ++i) lefts += ranks[order[i]] < left_size;
            left_before[begin / chunk_size] = lefts;
        });
        std::size_t sum = 0;
        for (std::size_t& lefts : left_before) sum += std::exchange(lefts, sum);
    }
    for_chunks(order.size(), token, [&](std::size_t begin, std::size_t end) {
        const std::size_t lefts = begin > 0 ? left_before[begin / chunk_size] : 0;
        std::uint32_t* to_left = left.data() + lefts;
        std::uint32_t* to_right = right.data() + (begin - lefts);
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t rank = ranks[order[i]];
            const bool is_left = rank < left_size;
            *(is_left ? to_left : to_right) = is_left ? rank : rank - left_size;
            to_left += is_left;
            to_right += !is_left;
        }
    });
}

}  // namespace

ReferenceSet sorted_references(const Mesh& mesh, const Token& token) {
    ReferenceSet set;
    set.resize(mesh.size());
    for_chunks(mesh.size(), token, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            set.references[i] = {mesh.box(i), std::uint32_t(i), is_splittable(mesh.triangle(i))};
    });
    Array<std::uint32_t> keys(mesh.size());
    for (int axis = 0; axis < 3; ++axis) {
        auto& order = set.orders[std::size_t(axis)];
        for_chunks(mesh.size(), token, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                keys[i] = ordered_bits(doubled_centre(set.references[i], axis));
                order[i] = std::uint32_t(i);
            }
        });
        radix_sort(keys, order, 32, token);
    }
    return set;
}

ObjectSplit find_object_split(const ReferenceView& node, const Token& token) {
    const std::size_t count = node.size();
    if (count == 2 || all_centres_equal(node)) {
        ObjectSplit split{0.0, 0, count / 2};
        split.cost = split_cost(node, split, token);
        return split;
    }
    if (count > chunk_size) return sweep_large(node, token);
    ObjectSplit best;
    for (int axis = 0; axis < 3; ++axis)
        sweep(node, axis, {0, count, Box::empty(), Box::empty()}, best);
    return best;
}

std::pair<Box, Box> side_boxes(const ReferenceView& node, const ObjectSplit& split,
                               const Token& token) {
    const Order order = node.orders[std::size_t(split.axis)];
    const auto side = [&](Order part) {
        if (part.size() <= chunk_size) return box_of(node.references, part);
        std::vector<Box> boxes(chunk_count(part.size()));
        for_chunks(part.size(), token, [&](std::size_t begin, std::size_t end) {
            boxes[begin / chunk_size] = box_of(node.references, part.subspan(begin, end - begin));
        });
        Box box = Box::empty();
        for (const Box& chunk : boxes) box.grow(chunk);
        return box;
    };
    return {side(order.first(split.left_size)), side(order.subspan(split.left_size))};
}

void divide_objects(const ReferenceView& node, const ObjectSplit& split,
                    Array<std::uint32_t>& ranks, const ReferenceTarget& left,
                    const ReferenceTarget& right, const Token& token) {
    const std::size_t left_size = split.left_size;
    const auto axis = std::size_t(split.axis);
    if (ranks.size() < node.size()) ranks.resize(node.size());

    // Put the references in the order of the axis.
    for_chunks(node.size(), token, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t position = node.orders[axis][i];
            ranks[position] = std::uint32_t(i);
            const bool is_left = i < left_size;
            const std::size_t place = is_left ? i : i - left_size;
            const ReferenceTarget& side = is_left ? left : right;
            side.references[place] = node.references[position];
            side.orders[axis][place] = std::uint32_t(place);
        }
    });
    for (std::size_t other = 0; other < 3; ++other)
        if (other != axis)
            divide_order(node.orders[other], ranks, std::uint32_t(left_size), left.orders[other],
                         right.orders[other], token);
}

}  // namespace bvhlab
