// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/transforms.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "base/parallel.h"

namespace bvhlab {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

struct Corners {
    glm::dvec3 a, b, c;
};

template <std::size_t Floats>
using Transform = void(const Corners&, float (&)[Floats]);

void woop_affine(const Corners& corners, float (&values)[woop_affine_floats]) {
    const glm::dvec3 e1 = corners.b - corners.a, e2 = corners.c - corners.a;
    const glm::dvec3 normal = glm::cross(e1, e2);
    const double squared = glm::dot(normal, normal);
    const glm::dvec3 rows[3] = {normal / std::sqrt(squared), glm::cross(e2, normal) / squared,
                                glm::cross(normal, e1) / squared};
    for (int row = 0; row < 3; ++row) {
        for (int axis = 0; axis < 3; ++axis) values[4 * row + axis] = float(rows[row][axis]);
        values[4 * row + 3] = float(-glm::dot(rows[row], corners.a));
    }
}

void baldwin_weber(const Corners& corners, float (&values)[baldwin_weber_floats]) {
    const glm::dvec3 e1 = corners.b - corners.a, e2 = corners.c - corners.a;
    const glm::dvec3 normal = glm::cross(e1, e2), size = glm::abs(normal);
    const int x = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
    const int y = (x + 1) % 3, z = (x + 2) % 3;
    const double length = normal[x], ay = corners.a[y], az = corners.a[z];
    const double rows[3][2] = {{normal[y] / length, normal[z] / length},
                               {e2[z] / length, -e2[y] / length},
                               {-e1[z] / length, e1[y] / length}};
    for (int row = 0; row < 3; ++row) {
        values[3 * row] = float(rows[row][0]);
        values[3 * row + 1] = float(rows[row][1]);
        values[3 * row + 2] = float(-(rows[row][0] * ay + rows[row][1] * az));
    }
    values[2] = float(-(corners.a[x] + rows[0][0] * ay + rows[0][1] * az));
    values[9] = std::bit_cast<float>(std::int32_t(x));
}

/// Transforms of `count` triangles; `corners` and `values` are rows of `count` floats.
template <std::size_t Floats>
void transform_row(Transform<Floats>& transform, const float* corners, std::size_t count,
                   float* values) {
    const auto corner = [&](std::size_t which, std::size_t i) {
        const float* const rows = corners + 3 * which * count + i;
        return glm::dvec3(rows[0], rows[count], rows[2 * count]);
    };
    for (std::size_t i = 0; i < count; ++i) {
        float one[Floats];
        transform({corner(0, i), corner(1, i), corner(2, i)}, one);
        // The last float of Baldwin and Weber, an axis, is finite as it stands.
        if (!std::ranges::all_of(one, [](float value) { return std::isfinite(value); }))
            std::fill_n(one, std::min(Floats, std::size_t(9)), nan);
        for (std::size_t k = 0; k < Floats; ++k) values[k * count + i] = one[k];
    }
}

template <std::size_t Floats, unsigned K>
void transform_all(Transform<Floats>& transform, const WideBvh<K>& tree, TriangleTransforms& result,
                   const Token& token) {
    constexpr std::size_t lanes = WideBvh<K>::lanes;
    result.values.resize(tree.blocks.size() * lanes * Floats);
    parallel_for_each(tree.blocks.size(), 1024, token, [&](std::size_t block) {
        transform_row(transform, &tree.blocks[block].corners[0][0][0], lanes,
                      &result.values[block * lanes * Floats]);
    });
}

template <std::size_t Floats>
void transform_all(Transform<Floats>& transform, const CompressedBvh& tree,
                   TriangleTransforms& result, const Token& token) {
    const std::size_t used = tree.triangles.size() * Floats;
    result.values.resize(used + CompressedBvh::corner_padding);
    std::fill(result.values.begin() + std::ptrdiff_t(used), result.values.end(), 0.0F);
    parallel_for_each(tree.nodes.size(), 1024, token, [&](std::size_t index) {
        const CompressedNode& node = tree.nodes[index];
        for (unsigned slot = 0; slot < 8; ++slot) {
            if (node.is_missing(slot) || !node.is_leaf(slot)) continue;
            const std::size_t first = node.leaf_triangle(slot);
            transform_row(transform, &tree.corners[CompressedBvh::corner_floats * first],
                          node.leaf_size(slot), &result.values[Floats * first]);
        }
    });
}

template <std::size_t Floats>
std::shared_ptr<const TriangleTransforms> made(Transform<Floats>& transform, const Bvh& bvh,
                                               const Token& token) {
    const auto result = std::make_shared<TriangleTransforms>();
    result->per_triangle = Floats;
    std::visit([&](const auto& tree) { transform_all(transform, tree, *result, token); }, bvh.tree);
    return result;
}

/// What `kept` holds, made first where it holds nothing yet. Two threads that come at the same time
/// both make it: waiting for the other would hold up a task that the other may be waiting for.
template <std::size_t Floats>
std::shared_ptr<const TriangleTransforms> kept_or_made(
    std::shared_ptr<const TriangleTransforms>& kept, Transform<Floats>& transform, const Bvh& bvh,
    const Token& token) {
    {
        const std::scoped_lock lock(bvh.transforms->mutex);
        if (kept) return kept;
    }
    const auto result = made(transform, bvh, token);
    const std::scoped_lock lock(bvh.transforms->mutex);
    if (!kept) kept = result;
    return kept;
}

}  // namespace

std::size_t transform_floats(TriangleTest test) {
    if (test == TriangleTest::woop_affine) return woop_affine_floats;
    if (test == TriangleTest::baldwin_weber) return baldwin_weber_floats;
    return 0;
}

std::shared_ptr<const TriangleTransforms> triangle_transforms(const Bvh& bvh, TriangleTest test,
                                                              const Token& token) {
    if (test == TriangleTest::woop_affine)
        return kept_or_made(bvh.transforms->woop_affine, woop_affine, bvh, token);
    if (test == TriangleTest::baldwin_weber)
        return kept_or_made(bvh.transforms->baldwin_weber, baldwin_weber, bvh, token);
    return nullptr;
}

}  // namespace bvhlab
