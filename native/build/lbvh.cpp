// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/lbvh.h"

#include <tbb/parallel_invoke.h>

#include <bit>

#include "base/parallel.h"
#include "build/morton.h"
#include "build/radix_sort.h"

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

/// Builds the subtrees of Karras' tree, boxes on the way up. A subtree over the references
/// first..last has its last - first interior nodes at node, node + 1, ... in depth-first order.
struct SubtreeBuilder {
    const Array<std::uint64_t>& codes;
    BinaryBvh& bvh;
    const Token& token;

    /// Returns the root of the subtree. Recursion is at most 60 + 28 deep.
    std::uint32_t build(std::uint32_t node, std::uint32_t first, std::uint32_t last) const {
        if (first == last) return bvh.first_leaf() + first;
        const std::uint32_t split = find_split(codes, first, last);
        const std::uint32_t right_node = node + 1 + (split - first);
        std::uint32_t left, right;
        if (last - first < smallest_task) {
            left = build(node + 1, first, split);
            right = build(right_node, split + 1, last);
        } else {
            token.check();
            tbb::parallel_invoke([&] { left = build(node + 1, first, split); },
                                 [&] { right = build(right_node, split + 1, last); });
            // Once another task has thrown, oneTBB leaves nested calls early without an exception.
            token.check();
        }
        bvh.children[node] = {left, right};
        bvh.boxes[node] = unite(bvh.boxes[left], bvh.boxes[right]);
        return node;
    }
};

}  // namespace

BinaryBvh build_lbvh(const Mesh& mesh, Token& token) {
    token.begin("building LBVH");
    const std::size_t count = mesh.size();

    // Sort the triangles along the Morton curve.
    Array<Box> boxes(count);
    Array<std::uint64_t> codes(count);
    BinaryBvh bvh = BinaryBvh::with_references(count);
    const MortonGrid grid(mesh.bounds);
    parallel_for_each(count, 4096, token, [&](std::size_t i) {
        boxes[i] = mesh.box(i);
        codes[i] = grid.code(boxes[i]);
        bvh.references[i] = std::uint32_t(i);
    });
    token.advance(0.2F);
    radix_sort(codes, bvh.references, morton_bits, token);
    token.advance(0.6F);

    // Build the tree over the sorted order.
    parallel_for_each(count, 4096, token, [&](std::size_t i) {
        bvh.boxes[bvh.first_leaf() + i] = boxes[bvh.references[i]];
    });
    SubtreeBuilder{codes, bvh, token}.build(0, 0, std::uint32_t(count - 1));
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab
