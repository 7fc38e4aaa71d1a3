// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/array.h"
#include "scene/box.h"

namespace bvhlab {

/// A triangle, or after spatial splits a part of one, on its way to a leaf.
struct Reference {
    Box box;  ///< of the part, not padded (see clip.h)
    std::uint32_t triangle;
    std::uint32_t
        splittable;  ///< 0 where a spatial split must not cut it: the triangle has no area
};
static_assert(sizeof(Reference) == 32);

/// The references of one node, and their positions in `references` by ascending box centre on each
/// axis.
struct ReferenceView {
    std::span<const Reference> references;
    std::array<std::span<const std::uint32_t>, 3> orders;

    std::size_t size() const { return references.size(); }
};

/// Where the references of a new node are written.
struct ReferenceTarget {
    std::span<Reference> references;
    std::array<std::span<std::uint32_t>, 3> orders;
};

/// Storage for the references of one node, or of several one after the other; each node's orders
/// count from its own first reference.
struct ReferenceSet {
    Array<Reference> references;
    std::array<Array<std::uint32_t>, 3> orders;

    std::size_t size() const { return references.size(); }

    void resize(std::size_t size) {
        references.resize(size);
        for (auto& order : orders) order.resize(size);
    }

    ReferenceView view(std::size_t begin, std::size_t count) const {
        const auto part = [&](const auto& array) { return std::span(array).subspan(begin, count); };
        return {part(references), {part(orders[0]), part(orders[1]), part(orders[2])}};
    }

    ReferenceTarget target(std::size_t begin, std::size_t count) {
        const auto part = [&](auto& array) { return std::span(array).subspan(begin, count); };
        return {part(references), {part(orders[0]), part(orders[1]), part(orders[2])}};
    }
};

}  // namespace bvhlab
