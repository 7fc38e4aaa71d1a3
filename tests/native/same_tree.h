// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstring>

#include "bvh/binary_bvh.h"

namespace bvhlab::test {

/// Whether two trees are equal bit for bit, node by node.
inline bool same(const BinaryBvh& a, const BinaryBvh& b) {
    return a.references == b.references &&
           std::memcmp(a.children.data(), b.children.data(),
                       a.children.size() * sizeof(a.children[0])) == 0 &&
           std::memcmp(a.boxes.data(), b.boxes.data(), a.boxes.size() * sizeof(a.boxes[0])) == 0;
}

}  // namespace bvhlab::test
