// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/sah.h"

#include "build/top_down.h"

namespace bvhlab {

BinaryBvh build_sah(const Mesh& mesh, const CostModel& model, Token& token) {
    return build_top_down(mesh, {.stage = "building SAH", .model = model}, token);
}

}  // namespace bvhlab
