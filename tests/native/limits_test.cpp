// SPDX-License-Identifier: GPL-3.0-or-later
// Sums over as many nodes as trees have, keys at the ends of their range, and what does not fit.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "base/parallel.h"
#include "build/morton.h"
#include "build/radix_sort.h"
#include "build/sbvh.h"
#include "bvh/binary_bvh.h"
#include "bvh/cost.h"
#include "bvh/wide_bvh.h"
#include "meshes.h"
#include "render/camera_rays.h"
#include "render/film.h"
#include "render/renderer.h"

namespace bvhlab {
namespace {

constexpr double roundoff = 0x1p-53;  // of double

/// Boxes from far to tiny: their areas cover 24 orders of magnitude.
Box random_box(std::mt19937& random) {
    const float size = std::pow(10.0F, test::uniform(random, -6.0F, 6.0F));
    const glm::vec3 lower = test::uniform_vector(random, -size, size);
    return {lower, lower + test::uniform_vector(random, 0.0F, size)};
}

// --- sums ----------------------------------------------------------------------------------------

TEST(Sums, CostOverTenMillionNodes) {
    // Chunks of at most 4096 terms are summed one after the other, then in pairs: no term takes
    // part in more than 4096 + 13 additions, and a term itself is six roundings off.
    constexpr std::size_t references = 5'000'000;
    BinaryBvh bvh = BinaryBvh::with_references(references);
    std::mt19937 random(1);
    std::generate(bvh.boxes.begin(), bvh.boxes.end(), [&] { return random_box(random); });
    const CostModel model{3.0, 2.0};
    long double exact = 0.0L;
    for (std::size_t node = 0; node < bvh.node_count(); ++node)
        exact += static_cast<long double>(bvh.boxes[node].half_area()) *
                 (node < references - 1 ? 3.0L : 2.0L);
    exact /= static_cast<long double>(bvh.boxes[0].half_area());
    const double found = with_threads(1, [&] { return cost(bvh, model); });
    EXPECT_NEAR(found, double(exact), 4120.0 * roundoff * double(exact));
    for (const int threads : {2, 3, 8})
        EXPECT_EQ(found, with_threads(threads, [&] { return cost(bvh, model); }));
}

TEST(Sums, CostOfAWideTreeOfMillionsOfNodes) {
    // One term after the other: no term takes part in more additions than there are terms.
    constexpr std::size_t nodes = 1'250'000, boxes = 8 * nodes;
    Bvh bvh;
    auto& wide = bvh.tree.emplace<WideBvh<8>>();
    wide.nodes.resize(nodes);
    std::mt19937 random(2);
    long double exact = 0.0L;
    Box scene = Box::empty();
    for (std::size_t node = 0; node < nodes; ++node)
        for (unsigned child = 0; child < 8; ++child) {
            const Box box = random_box(random);
            const std::uint32_t size = random() % 3;  // 0: an interior node
            wide.nodes[node].set_child(child, box, 1, size);
            if (node == 0) scene.grow(box);
            exact += static_cast<long double>(box.half_area()) * (size == 0 ? 3.0L : 16.0L);
        }
    exact = exact / static_cast<long double>(scene.half_area()) + 3.0L;
    EXPECT_NEAR(cost(bvh, {3.0, 2.0}), double(exact), boxes * roundoff * double(exact));
}

TEST(Sums, FilmsOfManySamplesAreWithinTheBoundOfOneByOneAddition) {
    // Each pixel's samples are added one by one in double: n - 1 roundings.
    constexpr std::uint32_t samples = 1 << 20;
    Film film(1, false);
    std::mt19937 random(3);
    std::vector<glm::vec3> radiance(samples);
    long double exact = 0.0L;
    for (glm::vec3& value : radiance) {
        value = glm::vec3(std::pow(10.0F, test::uniform(random, -12.0F, 6.0F)));
        exact += static_cast<long double>(value.x);
    }
    film.add({0, 1, 0, samples}, radiance, {});
    const double mean = double(exact / samples);
    EXPECT_NEAR(film.picture().pixels[0].x, mean, (samples * roundoff + 0x1p-24) * mean);
}

// --- keys ----------------------------------------------------------------------------------------

TEST(Keys, SortAtTheEndsOfTheirRange) {
    constexpr std::uint64_t highest = (1ULL << 60) - 1;
    std::mt19937_64 random(4);
    constexpr std::size_t count = 100'000;  // several blocks
    for (const std::uint64_t last : {highest, ~std::uint64_t(0)}) {
        std::vector<Array<std::uint64_t>> inputs(5, Array<std::uint64_t>(count));
        for (std::size_t i = 0; i < count; ++i) {
            inputs[0][i] = random() % 2 ? last : 0;       // both ends
            inputs[1][i] = last;                          // all equal
            inputs[2][i] = last - (count - 1 - i);        // sorted
            inputs[3][i] = last - i;                      // reversed
            inputs[4][i] = (last >> (i % 64)) ^ (i & 1);  // every digit
        }
        for (const Array<std::uint64_t>& keys : inputs) {
            Array<std::uint64_t> sorted = keys;
            Array<std::uint32_t> order(count);
            std::iota(order.begin(), order.end(), 0U);
            Array<std::uint32_t> expected = order;
            std::ranges::stable_sort(expected, {}, [&](std::uint32_t i) { return keys[i]; });
            radix_sort(sorted, order, last == highest ? 60 : 64, Token{});
            EXPECT_EQ(order, expected);
            EXPECT_TRUE(std::ranges::is_sorted(sorted));
        }
    }
}

TEST(Keys, MortonCodesOfAnyBoxAreInRangeAndInOrder) {
    constexpr float largest = 1e37F, least = std::numeric_limits<float>::denorm_min();
    const glm::vec3 lowers[] = {{-largest, -largest, -largest}, {0, 0, 0}, {1, 2, 3},
                                {-largest, 5, least},           {1, 1, 1}, {-1e-38F, 0, 1e30F}};
    const glm::vec3 uppers[] = {{largest, largest, largest},
                                {least, least, least},
                                {1, 2, 3},
                                {largest, 5, 2 * least},
                                {1, 2, std::nextafter(1.0F, 2.0F)},
                                {1e-38F, least, 1e37F}};
    for (int i = 0; i < 6; ++i) {
        const Box scene{lowers[i], uppers[i]};
        const MortonGrid grid(scene);
        EXPECT_EQ(grid.code({scene.lower, scene.lower}), 0U);
        const std::uint64_t last = grid.code({scene.upper, scene.upper});
        for (int axis = 0; axis < 3; ++axis) {  // flat axes are cell 0, others use all cells
            const std::uint64_t all = spread_by_three((1 << morton_bits_per_axis) - 1) << axis;
            EXPECT_EQ(last & all, scene.lower[axis] < scene.upper[axis] ? all : 0U) << i << axis;
        }
        EXPECT_LE(last, (1ULL << morton_bits) - 1);
        const std::uint64_t middle = grid.code(scene);
        EXPECT_LE(middle, last);
    }
}

// --- limits --------------------------------------------------------------------------------------

TEST(Limits, ReferencesFitIn32Bits) {
    constexpr std::uint64_t nodes = 2 * std::uint64_t(most_references) - 1;
    static_assert(nodes <= std::numeric_limits<std::uint32_t>::max());
    static_assert(most_triangles <= most_references);
    EXPECT_EQ(duplicate_budget(100, 8.0), 700U);
    EXPECT_EQ(duplicate_budget(100, 1.0), 0U);
    for (const std::size_t triangles : {std::size_t(1), most_triangles - 1, most_triangles}) {
        EXPECT_EQ(duplicate_budget(triangles, 0x1p31) + triangles,
                  triangles == 1 ? most_references : most_references);
        EXPECT_LE(duplicate_budget(triangles, 8.0) + triangles, most_references);
    }
}

TEST(Limits, TrianglesAreCountedBeforeAnythingIsMade) {
    EXPECT_NO_THROW(check_triangle_count(1));
    EXPECT_NO_THROW(check_triangle_count(most_triangles));
    EXPECT_THROW(check_triangle_count(0), std::invalid_argument);
    for (const std::size_t count :
         {most_triangles + 1, std::size_t(1) << 31, std::size_t(1) << 32, ~std::size_t(0)})
        EXPECT_THROW(check_triangle_count(count), std::invalid_argument) << count;
}

TEST(Limits, SamplesOfAPictureDoNotWrapAround) {
    EXPECT_EQ(added_samples(0, most_samples), most_samples);
    EXPECT_EQ(added_samples(most_samples - 1, 1), most_samples);
    EXPECT_EQ(added_samples(most_samples, 0), most_samples);
    for (const auto& [present, more] :
         {std::pair(most_samples, 1U), {1U, most_samples}, {1U, ~0U}, {~0U, 1U}})
        EXPECT_THROW(added_samples(present, more), std::invalid_argument);
}

TEST(Limits, PixelsAndPathsOfTheLargestPictureAreCountedRight) {
    constexpr std::uint64_t pixels = std::uint64_t(largest_side) * largest_side;
    static_assert(pixels <= std::numeric_limits<std::uint32_t>::max());
    // The last batch of the largest picture: pixel and sample numbers do not wrap around.
    const PathRange range{pixels - 4096, 4096, most_samples - 16, 16};
    EXPECT_EQ(range.size(), 65536U);
    EXPECT_EQ(range.pixel(65535), std::uint32_t(pixels - 1));
    EXPECT_EQ(range.sample(65535), most_samples - 1);
    // Rays leave the last pixel at the bottom right.
    Camera camera{};
    camera.kind = CameraKind::orthographic;
    camera.to_world = glm::dmat4(1.0);
    camera.left = 0.0, camera.right = largest_side;
    camera.bottom = 0.0, camera.top = largest_side;
    const CameraRay ray =
        camera_ray(camera, {largest_side, largest_side, 0}, std::uint32_t(pixels - 1), 0);
    EXPECT_EQ(ray.origin.x, float(largest_side - 0.5));
    EXPECT_EQ(ray.origin.y, 0.5F);
}

}  // namespace
}  // namespace bvhlab
