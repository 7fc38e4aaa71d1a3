// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "bvh/binary_bvh.h"

namespace bvhlab::test {

inline std::string joined(const std::string& left, const std::string& right) {
    return '(' + left + ' ' + right + ')';
}

/// A small tree as text, such as "((0 2) 1)": triangles in pairs of brackets, left child first.
inline std::string topology(const BinaryBvh& bvh, std::uint32_t node = 0) {
    if (bvh.is_leaf(node)) return std::to_string(bvh.reference(node));
    const auto [left, right] = bvh.children[node];
    return joined(topology(bvh, left), topology(bvh, right));
}

}  // namespace bvhlab::test
