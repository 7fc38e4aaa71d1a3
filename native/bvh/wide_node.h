// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "scene/box.h"

namespace bvhlab {

/// Interior node of a k-ary tree, 32k bytes (paper section 3): the boxes of its children, one plane
/// of all children after the other so that SIMD lanes are children, and where each child is.
///
/// Children come first, missing ones last: an empty box (lower = +inf, upper = -inf), which no ray
/// enters, index 0 and count 0.
template <unsigned K>
struct alignas(32) WideNode {
    float planes[6][K];      ///< lower x, upper x, lower y, upper y, lower z, upper z
    std::uint32_t child[K];  ///< interior child: node index; leaf: its first triangle block
    std::uint32_t count[K];  ///< interior child: 0; leaf: number of references

    bool is_missing(unsigned i) const { return planes[0][i] > planes[1][i]; }
    bool is_leaf(unsigned i) const { return count[i] != 0; }

    Box box(unsigned i) const {
        return {{planes[0][i], planes[2][i], planes[4][i]},
                {planes[1][i], planes[3][i], planes[5][i]}};
    }
    void set_box(unsigned i, const Box& box) {
        for (int axis = 0; axis < 3; ++axis) {
            planes[2 * axis][i] = box.lower[axis];
            planes[2 * axis + 1][i] = box.upper[axis];
        }
    }
    void set_child(unsigned i, const Box& box, std::uint32_t index, std::uint32_t references) {
        set_box(i, box);
        child[i] = index;
        count[i] = references;
    }
    void set_missing(unsigned i) { set_child(i, Box::empty(), 0, 0); }
};
static_assert(sizeof(WideNode<2>) == 64 && sizeof(WideNode<4>) == 128 &&
              sizeof(WideNode<8>) == 256);

}  // namespace bvhlab
