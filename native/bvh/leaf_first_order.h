// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "base/token.h"
#include "bvh/binary_bvh.h"

namespace bvhlab {

/// Calls `visit(node)` for every interior node, each after its children, subtrees in parallel.
/// Without recursion: a tree may be as deep as it has references.
template <class Visit>
void for_each_leaf_first(const BinaryBvh& bvh, const Token& token, Visit&& visit) {
    if (bvh.children.empty()) return;

    // Open the tree breadth-first until there are enough subtrees to share out.
    constexpr std::size_t subtrees_wanted = 512;
    std::vector<std::uint32_t> top{0};  // opened nodes, then the roots of subtrees
    std::size_t opened = 0;
    while (opened < top.size() && top.size() - opened < subtrees_wanted) {
        const auto [left, right] = bvh.children[top[opened++]];
        if (!bvh.is_leaf(left)) top.push_back(left);
        if (!bvh.is_leaf(right)) top.push_back(right);
    }

    // Each subtree in reverse of the order in which a parent is met before its children.
    parallel_for_each(top.size() - opened, 1, token, [&](std::size_t subtree) {
        std::vector<std::uint32_t> order, pending{top[opened + subtree]};
        while (!pending.empty()) {
            const std::uint32_t node = pending.back();
            pending.pop_back();
            order.push_back(node);
            const auto [left, right] = bvh.children[node];
            if (!bvh.is_leaf(left)) pending.push_back(left);
            if (!bvh.is_leaf(right)) pending.push_back(right);
        }
        for (std::size_t i = order.size(); i-- > 0;) visit(order[i]);
    });
    for (std::size_t i = opened; i-- > 0;) visit(top[i]);
}

}  // namespace bvhlab
