// SPDX-License-Identifier: GPL-3.0-or-later
// Small scenes, and pictures of them.
#pragma once

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include "build/builder.h"
#include "bvh/collapse.h"
#include "meshes.h"
#include "render/renderer.h"

namespace bvhlab::test {

inline BinaryBvh binary_tree_of(const Mesh& mesh, std::string_view builder) {
    Token token;
    const BuilderInfo& info = find_builder(builder);
    BuildLog log;
    Parameters few;  // annealing would take thousands
    for (const ParameterInfo& parameter : info.parameters)
        if (parameter.name == "iterations") few.emplace("iterations", 10.0);
    return info.build(mesh, {}, check_parameters(info, few), token, log);
}

inline Bvh tree_of(const std::shared_ptr<const Mesh>& mesh, std::string_view builder = "lbvh",
                   unsigned branching = 8) {
    Token token;
    return collapse(binary_tree_of(*mesh, builder), mesh, branching, {}, token);
}

inline Scene scene_of(Mesh mesh, std::vector<Light> lights, float world = 0.0F,
                      Material material = {}) {
    Array<std::uint32_t> index(mesh.size(), 0U);
    return make_scene({shared(std::move(mesh)),
                       {material},
                       std::move(index),
                       std::move(lights),
                       {glm::vec3(world)}});
}

/// A square in the plane at this height, of half side `half`.
inline void add_square(Array<glm::vec3>& vertices, Array<glm::uvec3>& triangles, float height,
                       float half) {
    const auto first = std::uint32_t(vertices.size());
    for (const glm::vec2 corner : {glm::vec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
        vertices.push_back({corner * half, height});
    triangles.push_back({first, first + 1, first + 2});
    triangles.push_back({first, first + 2, first + 3});
}

inline Mesh plane(float half = 100.0F) {
    Array<glm::vec3> vertices;
    Array<glm::uvec3> triangles;
    add_square(vertices, triangles, 0.0F, half);
    return make_mesh(std::move(vertices), std::move(triangles));
}

inline Light lamp(LightKind kind, float power, const glm::dvec3& place) {
    Light light;
    light.kind = kind;
    light.to_world = glm::translate(glm::dmat4(1.0), place);
    light.color = glm::vec3(power);
    return light;
}

/// Looks down from a height of 5 on a square of this half side.
inline Camera from_above(double half) {
    Camera camera;
    camera.kind = CameraKind::orthographic;
    camera.to_world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 5));
    camera.left = camera.bottom = -half;
    camera.right = camera.top = half;
    return camera;
}

inline Material diffuse(float color, float emission) {
    Component component;
    component.color.value = glm::vec3(color);
    return {{component}, {glm::vec3(emission)}};
}

inline const Material white = diffuse(1.0F, 0.0F);

struct PictureOptions {
    std::uint32_t samples = 1;
    PathSettings paths{.depth = 8, .shadow_rays = 2};
    Reorder reorder = Reorder::off;
    bool passes = false;
    int threads = 0;
    std::size_t batch = RenderOptions{}.batch;
    std::uint32_t seed = 3;

    RenderOptions render() const { return {{paths, reorder, passes}, threads, batch}; }
};

inline Picture picture_of(const Bvh& bvh, const Scene& scene, const Camera& camera,
                          std::uint32_t side, const PictureOptions& options = {}) {
    Token token;
    return render({bvh, scene, camera, {side, side, options.seed}}, options.samples,
                  options.render(), token);
}

inline Picture picture_of(const Scene& scene, const Camera& camera, std::uint32_t side,
                          const PictureOptions& options = {}) {
    return picture_of(tree_of(scene.mesh), scene, camera, side, options);
}

/// Of the red channel.
inline double mean(const Picture& picture) {
    double sum = 0.0;
    for (const glm::vec3& pixel : picture.film.pixels) sum += double(pixel.x);
    return sum / double(picture.film.pixels.size());
}

}  // namespace bvhlab::test
