// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/expanded.h"

#include <cmath>

#include "scene/exact_volume.h"

namespace bvhlab {

double expanded_edge_function(const PreparedRay& ray, const float (&from)[3],
                              const float (&to)[3]) {
    const glm::vec3 p(from[0], from[1], from[2]), q(to[0], to[1], to[2]);
    const double length = ray.given_direction[ray.kz];
    return exact_volume(ray.origin, ray.given_direction, p, q).value() / length;
}

bool expanded_plane_crossing(const PreparedRay& ray, const float (&corners)[3][3],
                             PlaneCrossing& crossing) {
    const auto corner = [&](int i) {
        return glm::vec3(corners[i][0], corners[i][1], corners[i][2]);
    };
    const glm::vec3 a = corner(0), b = corner(1), c = corner(2);
    const ExactSum at_b = exact_volume(ray.origin, ray.given_direction, c, a);
    const ExactSum at_c = exact_volume(ray.origin, ray.given_direction, a, b);
    ExactSum determinant = exact_volume(ray.origin, ray.given_direction, b, c);
    determinant.add_scaled(at_b, 1.0);
    determinant.add_scaled(at_c, 1.0);
    // det(a - o, b - o, c - o)
    ExactSum numerator = exact_volume(ray.origin, a, b, c);
    numerator.add_scaled(exact_volume(ray.origin, ray.origin, b, c), -1.0);

    const auto side = [&](float t) {  // sign of the crossing's t - t
        ExactSum difference = numerator;
        difference.add_scaled(determinant, -double(t));
        return difference.sign() * determinant.sign();
    };
    if (side(ray.given_t_min) < 0) return false;
    if (std::isfinite(ray.given_t_max) && side(ray.given_t_max) > 0) return false;
    const double area = determinant.value();
    crossing = {numerator.value() / area / ray.unscale, at_b.value() / area, at_c.value() / area};
    return true;
}

}  // namespace bvhlab
