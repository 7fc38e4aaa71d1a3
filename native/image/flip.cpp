// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers of sections: Andersson et al., FLIP, Proc. ACM on Computer Graphics and Interactive
// Techniques 3(2), 2020.
#include "image/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <numbers>
#include <span>
#include <vector>

#include "base/parallel.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

// --- planes and their convolution ----------------------------------------------------------------

/// One channel of a picture.
struct Plane {
    int width, height;
    Array<float> values;

    Plane(int columns, int rows)
        : width(columns), height(rows), values(std::size_t(columns) * std::size_t(rows)) {}
    float* row(int y) { return values.data() + std::size_t(y) * std::size_t(width); }
    const float* row(int y) const { return values.data() + std::size_t(y) * std::size_t(width); }
};

using Planes = std::array<Plane, 3>;
using Kernel = std::vector<float>;  ///< odd in length, about its middle

template <class Body>
void for_rows(int height, Body&& body) {
    parallel_for_each(std::size_t(height), 8, Token(), [&](std::size_t y) { body(int(y)); });
}

/// Beyond its borders a picture goes on with its outermost pixels.
Plane convolve_rows(const Plane& plane, const Kernel& kernel) {
    Plane result(plane.width, plane.height);
    const int radius = int(kernel.size() / 2), last = plane.width - 1;
    for_rows(plane.height, [&](int y) {
        const float* from = plane.row(y);
        float* to = result.row(y);
        for (int x = 0; x <= last; ++x) {
            float sum = 0.0F;
            if (x >= radius && x + radius <= last)
                for (int i = -radius; i <= radius; ++i)
                    sum += kernel[std::size_t(radius + i)] * from[x + i];
            else
                for (int i = -radius; i <= radius; ++i)
                    sum += kernel[std::size_t(radius + i)] * from[std::clamp(x + i, 0, last)];
            to[x] = sum;
        }
    });
    return result;
}

Plane convolve_columns(const Plane& plane, const Kernel& kernel) {
    Plane result(plane.width, plane.height);
    const int radius = int(kernel.size() / 2), last = plane.height - 1;
    for_rows(plane.height, [&](int y) {
        float* to = result.row(y);
        std::fill(to, to + plane.width, 0.0F);
        for (int i = -radius; i <= radius; ++i) {
            const float* from = plane.row(std::clamp(y + i, 0, last));
            const float factor = kernel[std::size_t(radius + i)];
            for (int x = 0; x < plane.width; ++x) to[x] += factor * from[x];
        }
    });
    return result;
}

template <class Function>
Kernel sample_kernel(int radius, Function&& function) {
    Kernel kernel;
    for (int i = -radius; i <= radius; ++i) kernel.push_back(float(function(double(i))));
    return kernel;
}

/// Scales positive and negative weights apart, each to a sum of 1 or -1.
void normalise_signs(Kernel& kernel) {
    double positive = 0.0, negative = 0.0;
    for (const float weight : kernel) (weight > 0.0F ? positive : negative) += weight;
    for (float& weight : kernel)
        weight = float(weight / (weight > 0.0F ? positive : std::abs(negative)));
}

Kernel gaussian(int radius, double deviation) {
    Kernel kernel = sample_kernel(
        radius, [&](double x) { return std::exp(-x * x / (2.0 * deviation * deviation)); });
    normalise_signs(kernel);
    return kernel;
}

// --- colours
// ---------------------------------------------------------------------------------------

/// Linear sRGB to CIE XYZ: rows of the inverse of the sRGB primaries, in exact fractions.
constexpr double to_xyz[3][3] = {
    {10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0},
    {2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0},
    {1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0}};

const glm::dmat3 xyz_of_rgb =
    glm::transpose(glm::dmat3(to_xyz[0][0], to_xyz[0][1], to_xyz[0][2], to_xyz[1][0], to_xyz[1][1],
                              to_xyz[1][2], to_xyz[2][0], to_xyz[2][1], to_xyz[2][2]));
const glm::dmat3 rgb_of_xyz = glm::inverse(xyz_of_rgb);
const glm::dvec3 white = xyz_of_rgb * glm::dvec3(1.0);

/// Linear RGB to YyCxCz, the opponent space in which eyes blur (section 4.1.1).
glm::dvec3 opponent(const glm::dvec3& rgb) {
    const glm::dvec3 xyz = xyz_of_rgb * rgb / white;
    return {116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z)};
}

glm::dvec3 rgb_of_opponent(const glm::dvec3& color) {
    const double y = (color.x + 16.0) / 116.0;
    return rgb_of_xyz * (glm::dvec3(y + color.y / 500.0, y, y - color.z / 200.0) * white);
}

/// Linear RGB to CIELab with the Hunt effect: chroma times lightness (section 4.1.2).
glm::dvec3 hunt_lab(const glm::dvec3& rgb) {
    const glm::dvec3 xyz = xyz_of_rgb * rgb / white;
    constexpr double delta = 6.0 / 29.0;
    const auto root = [](double t) {
        return t > delta * delta * delta ? std::cbrt(t) : t / (3.0 * delta * delta) + 4.0 / 29.0;
    };
    const double x = root(xyz.x), y = root(xyz.y), z = root(xyz.z);
    const double lightness = 116.0 * y - 16.0;
    return {lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)};
}

/// The HyAB distance, for large differences of colour (section 4.1.2).
double hyab(const glm::dvec3& a, const glm::dvec3& b) {
    return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
}

Planes opponent_planes(const ImageView& image) {
    Planes planes{Plane(image.width, image.height), Plane(image.width, image.height),
                  Plane(image.width, image.height)};
    for_rows(image.height, [&](int y) {
        const float* rgb = image.values + std::size_t(y) * std::size_t(image.width) * 3;
        for (int x = 0; x < image.width; ++x, rgb += 3) {
            const glm::dvec3 color = opponent(
                glm::clamp(glm::dvec3(rgb[0], rgb[1], rgb[2]), glm::dvec3(0.0), glm::dvec3(1.0)));
            for (int i = 0; i < 3; ++i) planes[std::size_t(i)].row(y)[x] = float(color[i]);
        }
    });
    return planes;
}

// --- the eye's blur
// ----------------------------------------------------------------------------------

/// A sum of Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees: what the eye's contrast
/// sensitivity leaves of a point in one channel (section 4.1.1, Table 1).
struct Sensitivity {
    double a[2], b[2];
};
constexpr Sensitivity sensitivities[3] = {
    {{1.0, 0.0}, {0.0047, 1e-5}}, {{1.0, 0.0}, {0.0053, 1e-5}}, {{34.1, 13.5}, {0.04, 0.025}}};
constexpr double widest = 0.04;  ///< the greatest b

/// Each Gaussian separates into rows and columns; their sum, of weight 1, does not.
Plane blur(const Plane& plane, const Sensitivity& sensitivity) {
    const int radius =
        int(std::ceil(3.0 * std::sqrt(widest / (2.0 * pi * pi)) * flip_pixels_per_degree));
    Plane result(plane.width, plane.height);
    std::fill(result.values.begin(), result.values.end(), 0.0F);
    double shares[2], total = 0.0;
    for (int i = 0; i < 2; ++i) {
        const double decay =
            pi * pi / (sensitivity.b[i] * flip_pixels_per_degree * flip_pixels_per_degree);
        double side = 0.0;
        for (int x = -radius; x <= radius; ++x) side += std::exp(-decay * double(x * x));
        shares[i] = sensitivity.a[i] * std::sqrt(pi / sensitivity.b[i]) * side * side;
        total += shares[i];
    }
    for (int i = 0; i < 2; ++i) {
        if (shares[i] == 0.0) continue;
        const double deviation = flip_pixels_per_degree * std::sqrt(sensitivity.b[i] / 2.0) / pi;
        const Kernel kernel = gaussian(radius, deviation);
        const Plane part = convolve_columns(convolve_rows(plane, kernel), kernel);
        const float share = float(shares[i] / total);
        for_rows(plane.height, [&](int y) {
            const float* from = part.row(y);
            float* to = result.row(y);
            for (int x = 0; x < plane.width; ++x) to[x] += share * from[x];
        });
    }
    return result;
}

Planes perceived(const Planes& planes) {
    return {blur(planes[0], sensitivities[0]), blur(planes[1], sensitivities[1]),
            blur(planes[2], sensitivities[2])};
}

glm::dvec3 perceived_lab(const Planes& planes, int x, int y) {
    const glm::dvec3 color(planes[0].row(y)[x], planes[1].row(y)[x], planes[2].row(y)[x]);
    return hunt_lab(glm::clamp(rgb_of_opponent(color), glm::dvec3(0.0), glm::dvec3(1.0)));
}

// --- edges and points
// --------------------------------------------------------------------------------

/// How much of an edge and of a point there is at each pixel (section 4.2).
struct FeatureMaps {
    Plane edges, points;
};

Plane lengths(Plane&& a, const Plane& b) {
    for_rows(a.height, [&](int y) {
        for (int x = 0; x < a.width; ++x) a.row(y)[x] = std::hypot(a.row(y)[x], b.row(y)[x]);
    });
    return std::move(a);
}

FeatureMaps find_features(const Plane& achromatic) {
    constexpr double width = 0.082;  // degrees, of the features that are seen best
    const double deviation = 0.5 * width * flip_pixels_per_degree;
    const int radius = int(std::ceil(3.0 * deviation));
    const double variance = deviation * deviation;
    const auto bell = [&](double x) { return std::exp(-x * x / (2.0 * variance)); };
    const Kernel smooth = gaussian(radius, deviation);
    Kernel edge = sample_kernel(radius, [&](double x) { return -x * bell(x); });
    Kernel point =
        sample_kernel(radius, [&](double x) { return (x * x / variance - 1.0) * bell(x); });
    normalise_signs(edge);
    normalise_signs(point);

    Plane lightness(achromatic.width, achromatic.height);
    std::transform(achromatic.values.begin(), achromatic.values.end(), lightness.values.begin(),
                   [](float value) { return (value + 16.0F) / 116.0F; });
    const Plane smooth_rows = convolve_rows(lightness, smooth);
    return {lengths(convolve_columns(convolve_rows(lightness, edge), smooth),
                    convolve_columns(smooth_rows, edge)),
            lengths(convolve_columns(convolve_rows(lightness, point), smooth),
                    convolve_columns(smooth_rows, point))};
}

// --- the difference
// ------------------------------------------------------------------------------------

/// The distance of colours, to the power q_c, in [0, 1]: small ones get most of it (section 4.1.3).
double color_difference(const glm::dvec3& a, const glm::dvec3& b) {
    constexpr double q_c = 0.7, p_c = 0.4, p_t = 0.95;
    static const double most =
        std::pow(hyab(hunt_lab({0.0, 1.0, 0.0}), hunt_lab({0.0, 0.0, 1.0})), q_c);
    const double distance = std::pow(hyab(a, b), q_c), bend = p_c * most;
    const double result = distance < bend ? p_t / bend * distance
                                          : p_t + (distance - bend) / (most - bend) * (1.0 - p_t);
    return std::clamp(result, 0.0, 1.0);
}

double feature_difference(const FeatureMaps& a, const FeatureMaps& b, int x, int y) {
    constexpr double q_f = 0.5;
    const double edges = std::abs(double(a.edges.row(y)[x]) - double(b.edges.row(y)[x]));
    const double points = std::abs(double(a.points.row(y)[x]) - double(b.points.row(y)[x]));
    const double most = std::max(edges, points) / std::numbers::sqrt2;
    return std::clamp(std::pow(most, q_f), 0.0, 1.0);
}

}  // namespace

Array<float> flip_map(const ImageView& picture, const ImageView& reference) {
    const Planes planes = opponent_planes(picture), truth = opponent_planes(reference);
    const FeatureMaps features = find_features(planes[0]), true_features = find_features(truth[0]);
    const Planes seen = perceived(planes), truly_seen = perceived(truth);
    Array<float> result(picture.pixel_count());
    for_rows(picture.height, [&](int y) {
        float* to = result.data() + std::size_t(y) * std::size_t(picture.width);
        for (int x = 0; x < picture.width; ++x) {
            const double color =
                color_difference(perceived_lab(seen, x, y), perceived_lab(truly_seen, x, y));
            const double feature = feature_difference(features, true_features, x, y);
            to[x] = float(std::pow(color, 1.0 - feature));  // section 4.3
        }
    });
    return result;
}

}  // namespace bvhlab
