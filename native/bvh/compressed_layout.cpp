// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

#include "bvh/level_order.h"
#include "bvh/octant_slots.h"
#include "bvh/quantise.h"

namespace bvhlab {
namespace {

/// Puts the children of each node in order of their slots.
struct BySlots {
    const BinaryBvh& binary;

    void operator()(Opened<8>& opened) const {
        std::array<Box, 8> boxes;
        for (unsigned c = 0; c < opened.count; ++c) boxes[c] = binary.boxes[opened.child[c]];
        const auto slots = octant_slots({boxes.data(), opened.count});

        const Opened<8> unordered = opened;
        for (unsigned c = 0; c < opened.count; ++c) opened.slots |= std::uint8_t(1U << slots[c]);
        for (unsigned c = 0; c < opened.count; ++c) {
            const unsigned before = opened.slots & ((1U << slots[c]) - 1U);
            opened.child[std::size_t(std::popcount(before))] = unordered.child[c];
            opened.is_leaf[std::size_t(std::popcount(before))] = unordered.is_leaf[c];
        }
    }
};

using Order = LevelOrder<8, 1, BySlots>;  // blocks of one reference: no lane is left unused

/// Copies the corners of the references below a binary node: rows of as many floats as the leaf has
/// references.
class LeafFiller {
public:
    LeafFiller(const Order& order, const Mesh& mesh, CompressedBvh& tree)
        : order_(order), mesh_(mesh), tree_(tree) {}

    void fill(std::uint32_t subtree, std::uint32_t first, std::uint32_t size,
              std::vector<std::uint32_t>& pending) const {
        float* const rows = &tree_.corners[CompressedBvh::corner_floats * first];
        std::uint32_t lane = 0;
        order_.for_each_reference(subtree, pending, [&](std::uint32_t index) {
            const Triangle triangle = mesh_.triangle(index);
            const glm::vec3 corners[3] = {triangle.a, triangle.b, triangle.c};
            for (unsigned row = 0; row < CompressedBvh::corner_floats; ++row)
                rows[row * size + lane] = corners[row / 3][int(row % 3)];
            tree_.triangles[first + lane] = index;
            ++lane;
        });
    }

private:
    const Order& order_;
    const Mesh& mesh_;
    CompressedBvh& tree_;
};

/// Unary: as many bits from the right as there are references.
std::uint8_t leaf_meta(std::uint32_t size, std::uint32_t offset) {
    return std::uint8_t(((1U << size) - 1U) << 5 | offset);
}

std::uint8_t interior_meta(unsigned slot) {
    return std::uint8_t(1U << 5 | (CompressedNode::first_interior + slot));
}

}  // namespace

Bvh compressed_layout(const BinaryBvh& binary, const Array<Plan<8>>& plans,
                      std::shared_ptr<const Mesh> mesh, Token& token) {
    const Order order(binary, plans, BySlots{binary}, token);
    Bvh bvh;
    order.describe(bvh);
    CompressedBvh& tree = bvh.tree.emplace<CompressedBvh>();
    tree.nodes.resize(order.opened.size());
    tree.triangles.resize(order.end.reference);
    tree.corners.resize(CompressedBvh::corner_floats * order.end.reference +
                        CompressedBvh::corner_padding);
    std::fill_n(tree.corners.end() - CompressedBvh::corner_padding, CompressedBvh::corner_padding,
                0.0F);

    const LeafFiller leaves(order, *mesh, tree);
    order.for_each_node(*mesh, [&](std::size_t i, std::vector<std::uint32_t>& pending) {
        const Opened<8>& opened = order.opened[i];
        const Place place = order.places[i];
        CompressedNode& node = tree.nodes[i];
        node.interior_mask = 0;
        node.first_child = place.interior;
        node.first_triangle = place.block;
        std::fill_n(node.meta, 8, std::uint8_t(0));

        std::array<Box, 8> boxes;
        std::array<std::uint8_t, 8> slots;
        std::uint32_t offset = 0;
        unsigned unused = opened.slots;
        for (unsigned c = 0; c < opened.count; ++c, unused &= unused - 1) {
            const auto slot = unsigned(std::countr_zero(unused));
            boxes[c] = binary.boxes[opened.child[c]];
            slots[c] = std::uint8_t(slot);
            if (!opened.is_leaf[c]) {
                node.interior_mask |= std::uint8_t(1U << slot);
                node.meta[slot] = interior_meta(slot);
                continue;
            }
            const std::uint32_t size = order.size(opened.child[c]);
            node.meta[slot] = leaf_meta(size, offset);
            leaves.fill(opened.child[c], place.block + offset, size, pending);
            offset += size;
        }
        quantise({boxes.data(), opened.count}, {slots.data(), opened.count}, node);
    });
    bvh.mesh = std::move(mesh);
    token.advance(1.0F);
    return bvh;
}

}  // namespace bvhlab
