// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "opencl/tree_buffers.h"

namespace bvhlab::opencl {

/// The binary radix tree over sorted codes, in the numbering of Karras 2012: interior node i is
/// over the places between i and `other`, and its left child ends at place `split`.
struct RadixTree {
    struct Node {
        std::uint32_t other, split;
    };

    Buffer<Node> nodes;             ///< one less than codes
    Buffer<std::uint32_t> numbers;  ///< by node: its number in depth-first order
};

/// Builds that tree. Enqueues and does not wait; stage "hierarchy".
RadixTree radix_tree(Commands& commands, const Buffer<std::uint64_t>& codes);

/// build/lbvh.h on a device: the same tree, node for node. Throws Cancelled, Error.
DeviceBinary build_lbvh(Commands& commands, const DeviceMesh& mesh, Token& token);

}  // namespace bvhlab::opencl
