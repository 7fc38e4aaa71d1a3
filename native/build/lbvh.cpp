// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/lbvh.h"

#include <bit>
#include <utility>

#include "base/parallel.h"
#include "build/morton_order.h"

namespace bvhlab {
namespace {

constexpr std::uint32_t smallest_task =
    4096;  // references below which a subtree is built in one go

/// Length of the common prefix of the codes at two places of the sorted order; equal codes are
/// extended by the places themselves (Karras 2012, section 4).
int common_prefix(const Array<std::uint64_t>& codes, std::uint32_t i, std::uint32_t j) {
    const std::uint64_t difference = codes[i] ^ codes[j];
    return difference != 0 ? std::countl_zero(difference) : 64 + std::countl_zero(i ^ j);
}

/// The last place in [first, last) that shares more leading bits with `first` than `last` does.
std::uint32_t find_split(const Array<std::uint64_t>& codes, std::uint32_t first,
                         std::uint32_t last) {
    const int prefix = common_prefix(codes, first, last);
    std::uint32_t low = first, high = last;
    while (high - low > 1) {
        const std::uint32_t middle = low + (high - low) / 2;
        (common_prefix(codes, first, middle) > prefix ? low : high) = middle;
    }
    return low;
}

}  // namespace

std::uint32_t LbvhSubtrees::build(std::uint32_t node, std::uint32_t first,
                                  std::uint32_t last) const {
    if (first == last) return bvh.first_leaf() + first + leaf_shift;
    const std::uint32_t split = find_split(codes, first, last);
    const std::uint32_t right_node = node + 1 + (split - first);
    std::uint32_t left, right;
    if (last - first < smallest_task) {
        left = build(node + 1, first, split);
        right = build(right_node, split + 1, last);
    } else {
        token.check();
        parallel_invoke([&] { left = build(node + 1, first, split); },
                        [&] { right = build(right_node, split + 1, last); });
    }
    bvh.children[node] = {left, right};
    bvh.boxes[node] = unite(bvh.boxes[left], bvh.boxes[right]);
    return node;
}

BinaryBvh build_lbvh(const Mesh& mesh, Token& token) {
    token.begin("building LBVH");
    MortonOrder order = morton_order(mesh, token);
    token.advance(0.6F);

    // Build the tree over the sorted order.
    const std::size_t count = mesh.size();
    BinaryBvh bvh = BinaryBvh::with_references(count);
    bvh.references = std::move(order.references);
    parallel_for_each(count, 4096, token, [&](std::size_t i) {
        bvh.boxes[bvh.first_leaf() + i] = order.boxes[bvh.references[i]];
    });
    LbvhSubtrees{order.codes, bvh, token}.build(0, 0, std::uint32_t(count - 1));
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab
