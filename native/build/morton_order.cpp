// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/morton_order.h"

#include "base/parallel.h"
#include "build/morton.h"
#include "build/radix_sort.h"

namespace bvhlab {

MortonOrder morton_order(const Mesh& mesh, const Token& token) {
    const std::size_t count = mesh.size();
    MortonOrder order{Array<Box>(count), Array<std::uint64_t>(count), Array<std::uint32_t>(count)};
    const MortonGrid grid(mesh.bounds);
    parallel_for_each(count, 4096, token, [&](std::size_t i) {
        order.boxes[i] = mesh.box(i);
        order.codes[i] = grid.code(order.boxes[i]);
        order.references[i] = std::uint32_t(i);
    });
    radix_sort(order.codes, order.references, morton_bits, token);
    return order;
}

}  // namespace bvhlab
