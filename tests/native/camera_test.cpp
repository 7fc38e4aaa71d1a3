// SPDX-License-Identifier: GPL-3.0-or-later
// Camera rays against their closed forms: window, near plane, lens.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>

#include "render/camera_rays.h"

namespace bvhlab {
namespace {

using std::numbers::pi;

void expect_near(const glm::vec3& value, const glm::dvec3& expected, double tolerance = 1e-6) {
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(double(value[axis]), expected[axis], tolerance) << "axis " << axis;
}

TEST(CameraRays, PerspectiveCornersAreRowMajorFromTheTopLeft) {
    Camera camera;
    camera.left = -2.0;
    camera.right = 2.0;
    camera.clip_start = 0.25;
    const Raster raster{4, 2};
    const RayArrays rays = camera_rays(camera, raster, 0, 1, Token());
    ASSERT_EQ(rays.origins.size(), 8U);
    const std::array<glm::dvec3, 2> through{glm::dvec3(-1.5, 0.5, -1), glm::dvec3(1.5, -0.5, -1)};
    expect_near(rays.directions.front(), glm::normalize(through[0]));
    expect_near(rays.directions.back(), glm::normalize(through[1]));
    expect_near(rays.origins.front(), 0.25 * through[0]);
    expect_near(rays.origins.back(), 0.25 * through[1]);
}

TEST(CameraRays, OrthographicRaysAreParallelFromTheNearPlane) {
    Camera camera;
    camera.kind = CameraKind::orthographic;
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(10, 20, 30));
    camera.left = -2.0;
    camera.right = 2.0;
    camera.clip_start = 0.5;
    const RayArrays rays = camera_rays(camera, {4, 2}, 0, 1, Token());
    expect_near(rays.origins.front(), {8.5, 20.5, 29.5});
    expect_near(rays.origins.back(), {11.5, 19.5, 29.5});
    for (const glm::vec3& direction : rays.directions) EXPECT_EQ(direction, glm::vec3(0, 0, -1));
}

TEST(CameraRays, MatrixTurnsTheView) {
    Camera camera;
    camera.to_world = glm::rotate(glm::dmat4(1.0), pi / 2, glm::dvec3(1, 0, 0));
    const RayArrays rays = camera_rays(camera, {1, 1}, 0, 1, Token());
    expect_near(rays.directions[0], {0, 1, 0});
}

TEST(CameraRays, FurtherSamplesStayInTheirPixelAndSpreadOverIt) {
    Camera camera;
    camera.kind = CameraKind::orthographic;
    camera.left = camera.bottom = 0.0;
    camera.right = camera.top = 4.0;
    std::set<int> cells;
    for (std::uint32_t sample = 1; sample < 65; ++sample) {
        const CameraRay ray = camera_ray(camera, {4, 4, 5}, 6, sample);  // third column, second row
        EXPECT_GE(ray.origin.x, 2.0F);
        EXPECT_LE(ray.origin.x, 3.0F);
        EXPECT_GE(ray.origin.y, 2.0F);
        EXPECT_LE(ray.origin.y, 3.0F);
        cells.insert(int((ray.origin.x - 2.0F) * 4) * 4 + int((ray.origin.y - 2.0F) * 4));
    }
    EXPECT_EQ(cells.size(), 16U);
}

std::string camera_complaint(const Camera& camera) {
    try {
        check_camera(camera);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(CameraRays, BadCamerasAreNamed) {
    EXPECT_EQ(camera_complaint({}), "");
    Camera camera;
    camera.right = camera.left;
    EXPECT_NE(camera_complaint(camera).find("window"), std::string::npos);
    camera = {};
    camera.clip_start = -1.0;
    EXPECT_NE(camera_complaint(camera).find("clip_start"), std::string::npos);
    camera = {};
    camera.to_world[0] *= 2.0;
    EXPECT_NE(camera_complaint(camera).find("scale"), std::string::npos);
    camera = {};
    camera.to_world[3][1] = std::nan("");
    EXPECT_NE(camera_complaint(camera).find("to_world"), std::string::npos);
}

// --- lens ----------------------------------------------------------------------------------------

/// A camera somewhere, in a scene of this size.
Camera with_lens(CameraKind kind, double size) {
    Camera camera;
    camera.kind = kind;
    camera.to_world = glm::rotate(glm::dmat4(1.0), 0.8, glm::normalize(glm::dvec3(1, 2, -3)));
    camera.to_world[3] = glm::dvec4(size * glm::dvec3(3, -2, 1), 1.0);
    if (kind == CameraKind::orthographic)
        for (double* side : {&camera.left, &camera.right, &camera.bottom, &camera.top})
            *side *= size;
    camera.clip_start = 0.1 * size;
    camera.lens_radius = 0.25 * size;
    camera.focus_distance = 4.0 * size;
    return camera;
}

TEST(CameraLens, RaysOfAPointOfThePictureMeetInTheFocusPlane) {
    for (const CameraKind kind : {CameraKind::perspective, CameraKind::orthographic})
        for (const double size : {1.0, 1e-6, 1e6}) {
            const Camera camera = with_lens(kind, size);
            Camera sharp = camera;
            sharp.lens_radius = 0.0;
            const glm::dmat4 to_camera = glm::inverse(camera.to_world);
            glm::dvec2 mean(0.0);
            double mean_square = 0.0;
            constexpr std::uint32_t samples = 256;
            for (std::uint32_t sample = 1; sample <= samples; ++sample) {
                const auto in_focus = [&](const CameraRay& ray, double depth) {
                    const glm::dvec3 origin(to_camera * glm::dvec4(ray.origin, 1.0));
                    const glm::dvec3 direction(to_camera * glm::dvec4(ray.direction, 0.0));
                    return origin + direction * ((-depth - origin.z) / direction.z);
                };
                // The pinhole's ray of the same sample goes through the same point of the picture.
                const Raster raster{4, 3, 9};
                const CameraRay ray = camera_ray(camera, raster, 5, sample);
                const CameraRay straight = camera_ray(sharp, raster, 5, sample);
                EXPECT_NEAR(double(glm::length(ray.direction)), 1.0, 1e-6);
                const glm::dvec3 miss = in_focus(ray, camera.focus_distance) -
                                        in_focus(straight, camera.focus_distance);
                EXPECT_LT(glm::length(miss), 2e-6 * size);
                const glm::dvec3 start(to_camera * glm::dvec4(ray.origin, 1.0));
                EXPECT_NEAR(start.z, -camera.clip_start, 1e-6 * size);

                // Where it passes the lens, seen from the lens's centre.
                glm::dvec2 lens(in_focus(ray, 0.0));
                if (kind == CameraKind::orthographic) lens -= glm::dvec2(in_focus(straight, 0.0));
                EXPECT_LT(glm::length(lens), camera.lens_radius * 1.0001);
                mean += lens / double(samples);
                mean_square += glm::dot(lens, lens) / samples;
            }
            // A uniform disk: mean 0, and half the squared radius.
            EXPECT_LT(glm::length(mean), 0.02 * camera.lens_radius);
            EXPECT_NEAR(mean_square / (camera.lens_radius * camera.lens_radius), 0.5, 0.02);
        }
}

TEST(CameraLens, FirstSampleUsesTheLensToo) {
    const Camera camera = with_lens(CameraKind::perspective, 1.0);
    std::set<float> origins;
    for (std::uint32_t pixel = 0; pixel < 8; ++pixel)
        origins.insert(camera_ray(camera, {4, 2}, pixel, 0).origin.x);
    EXPECT_EQ(origins.size(), 8U);
}

TEST(CameraLens, BadLensesAreNamed) {
    Camera camera;
    camera.lens_radius = -1.0;
    EXPECT_NE(camera_complaint(camera).find("lens_radius"), std::string::npos);
    camera.lens_radius = std::nan("");
    EXPECT_NE(camera_complaint(camera).find("lens_radius"), std::string::npos);
    camera.lens_radius = 1.0;
    camera.focus_distance = 0.0;
    EXPECT_NE(camera_complaint(camera).find("focus_distance"), std::string::npos);
}

}  // namespace
}  // namespace bvhlab
