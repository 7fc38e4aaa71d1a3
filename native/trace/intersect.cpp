// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/intersect.h"

#include "scene/exact_volume.h"

namespace bvhlab {

double exact_edge_function(const PreparedRay& ray, const float (&from)[3], const float (&to)[3]) {
    const glm::vec3 p(from[0], from[1], from[2]), q(to[0], to[1], to[2]);
    const double length = ray.given_direction[ray.kz];
    return exact_volume(ray.origin, ray.given_direction, p, q).value() / length;
}

}  // namespace bvhlab
