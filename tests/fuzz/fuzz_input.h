// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

/// Rays held as arrays, with an interval each.
struct FuzzRays {
    std::vector<glm::vec3> origins, directions;
    std::vector<float> t_min, t_max;

    RayBatch batch() const { return {origins, directions, t_min, t_max}; }
};

/// Makes meshes and rays of bytes, first come, first served; zeros once they are used up.
class FuzzInput {
public:
    FuzzInput(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}

    unsigned byte() {
        if (bytes_.empty()) return 0;
        const unsigned first = bytes_.front();
        bytes_ = bytes_.subspan(1);
        return first;
    }

    /// Up to 32 triangles on up to 32 vertices. Throws std::invalid_argument for bad numbers.
    Mesh mesh() {
        style_ = byte();
        Array<glm::vec3> vertices(byte() % 33);
        Array<glm::uvec3> triangles(byte() % 33);
        for (glm::vec3& vertex : vertices) vertex = point();
        const auto index = [&] {  // now and then one that is not there
            const unsigned number = byte();
            return number < 250 && !vertices.empty() ? number % std::uint32_t(vertices.size())
                                                     : number;
        };
        for (glm::uvec3& triangle : triangles) {
            triangle.x = index();
            triangle.y = index();
            triangle.z = index();
        }
        return make_mesh(std::move(vertices), std::move(triangles));
    }

    /// Up to 16 good rays, some of them aimed at vertices, others starting there.
    FuzzRays rays(const Mesh& mesh) {
        FuzzRays rays;
        for (unsigned left = byte() % 17; left > 0; --left) {
            const unsigned aim = byte();
            const glm::vec3& vertex = mesh.vertices[byte() % mesh.vertices.size()];
            const glm::vec3 origin = aim % 4 == 1 ? vertex : point();
            const glm::vec3 direction = aim % 4 == 2 ? vertex - origin : point();
            const float from = std::abs(interval_end(aim / 4 % 4, 0.0F));
            const float to = interval_end(aim / 16 % 4, std::numeric_limits<float>::infinity());
            if (!is_good(origin) || !is_good(direction) || direction == glm::vec3(0.0F)) continue;
            if (!std::isfinite(from) || std::isnan(to)) continue;
            rays.origins.push_back(origin);
            rays.directions.push_back(direction);
            rays.t_min.push_back(from);
            rays.t_max.push_back(to);
        }
        return rays;
    }

private:
    static bool is_good(const glm::vec3& v) {
        return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
    }

    glm::vec3 point() {
        glm::vec3 result;
        for (int axis = 0; axis < 3; ++axis) result[axis] = number();
        return result;
    }

    float any_float() {
        std::uint32_t bits = 0;
        for (int i = 0; i < 4; ++i) bits = bits << 8 | byte();
        return std::bit_cast<float>(bits);
    }

    /// Any float, or one of a lattice whose numbers meet each other, of a size from 2^-149 to
    /// 2^106.
    float number() {
        if (style_ % 4 == 0) return any_float();
        const auto lattice = float(std::int8_t(byte()));
        return std::ldexp(lattice, int(style_ / 4) * 4 - 149);
    }

    float interval_end(unsigned choice, float usual) {
        if (choice < 2) return usual;
        return choice == 2 ? float(byte()) / 16.0F : any_float();
    }

    std::span<const std::uint8_t> bytes_;
    unsigned style_ = 0;
};

}  // namespace bvhlab
