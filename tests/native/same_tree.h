// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstring>

#include "bvh/binary_bvh.h"

namespace bvhlab::test {

template <class T>
bool same_bits(const Array<T>& a, const Array<T>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// Whether two trees are equal bit for bit, node by node.
inline bool same(const BinaryBvh& a, const BinaryBvh& b) {
    return a.references == b.references && same_bits(a.children, b.children) &&
           same_bits(a.boxes, b.boxes);
}

}  // namespace bvhlab::test
