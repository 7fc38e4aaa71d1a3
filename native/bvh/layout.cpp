// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/layout.h"

#include <utility>
#include <vector>

#include "bvh/level_order.h"

namespace bvhlab {
namespace {

template <unsigned Lanes>
void set_lane(TriangleBlock<Lanes>& block, unsigned lane, const Triangle& triangle,
              std::uint32_t index) {
    const glm::vec3* corners[3] = {&triangle.a, &triangle.b, &triangle.c};
    for (int corner = 0; corner < 3; ++corner)
        for (int axis = 0; axis < 3; ++axis)
            block.corners[corner][axis][lane] = (*corners[corner])[axis];
    block.triangle[lane] = index;
}

}  // namespace

template <unsigned K>
Bvh breadth_first_layout(const BinaryBvh& binary, const Array<Plan<K>>& plans,
                         std::shared_ptr<const Mesh> mesh, Token& token) {
    constexpr unsigned lanes = block_lanes<K>;
    const auto from_left_to_right = [](Opened<K>&) {};
    const LevelOrder<K, lanes, decltype(from_left_to_right)> order(binary, plans,
                                                                   from_left_to_right, token);
    Bvh bvh;
    order.describe(bvh);
    auto& wide = bvh.tree.template emplace<WideBvh<K>>();
    wide.nodes.resize(order.opened.size());
    wide.blocks.resize(order.end.block);

    // Copies the triangles below a binary node, depth-first, into consecutive blocks.
    const auto fill_blocks = [&](std::uint32_t subtree, TriangleBlock<lanes>* blocks,
                                 std::vector<std::uint32_t>& pending) {
        std::uint32_t filled = 0;
        Triangle triangle;
        order.for_each_reference(subtree, pending, [&](std::uint32_t index) {
            triangle = mesh->triangle(index);
            set_lane(blocks[filled / lanes], filled % lanes, triangle, index);
            ++filled;
        });
        for (; filled % lanes != 0; ++filled)
            set_lane(blocks[filled / lanes], filled % lanes, triangle, no_triangle);
    };
    order.for_each_node(*mesh, [&](std::size_t i, std::vector<std::uint32_t>& pending) {
        const Opened<K>& opened = order.opened[i];
        WideNode<K>& node = wide.nodes[i];
        Place place = order.places[i];
        for (unsigned c = 0; c < opened.count; ++c) {
            const std::uint32_t child = opened.child[c];
            if (opened.is_leaf[c]) {
                const std::uint32_t size = order.size(child);
                node.set_child(c, binary.boxes[child], place.block, size);
                fill_blocks(child, &wide.blocks[place.block], pending);
                place.block += (size + lanes - 1) / lanes;
            } else {
                node.set_child(c, binary.boxes[child], place.interior++, 0);
            }
        }
        for (unsigned c = opened.count; c < K; ++c) node.set_missing(c);
    });
    bvh.mesh = std::move(mesh);
    token.advance(1.0F);
    return bvh;
}

template Bvh breadth_first_layout<2>(const BinaryBvh&, const Array<Plan<2>>&,
                                     std::shared_ptr<const Mesh>, Token&);
template Bvh breadth_first_layout<4>(const BinaryBvh&, const Array<Plan<4>>&,
                                     std::shared_ptr<const Mesh>, Token&);
template Bvh breadth_first_layout<8>(const BinaryBvh&, const Array<Plan<8>>&,
                                     std::shared_ptr<const Mesh>, Token&);

}  // namespace bvhlab
