// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/exact_volume.h"

namespace bvhlab {

void add_determinant(ExactSum& sum, const glm::vec3& x, const glm::vec3& y, const glm::vec3& z) {
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        const int k = (i + 2) % 3;
        sum.add_product(x[i], y[j], z[k]);
        sum.add_product(-x[i], y[k], z[j]);
    }
}

ExactSum exact_volume(const glm::vec3& origin, const glm::vec3& direction, const glm::vec3& p,
                      const glm::vec3& q) {
    ExactSum volume;
    add_determinant(volume, direction, p, q);
    add_determinant(volume, -direction, p, origin);
    add_determinant(volume, -direction, origin, q);
    return volume;
}

}  // namespace bvhlab
