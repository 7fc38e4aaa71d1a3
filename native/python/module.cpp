// SPDX-License-Identifier: GPL-3.0-or-later
#include "python/convert.h"

/// The compiled core. Argument checks and conversion only; every algorithm is below this room.
PYBIND11_MODULE(_core, module) {
    module.doc() = "BVH Lab's native core: build, trace and judge bounding volume hierarchies.";
    module.attr("__version__") = BVHLAB_VERSION;
    bvhlab::bind_core(module);
    bvhlab::bind_device(module);
    bvhlab::bind_build(module);
    bvhlab::bind_metrics(module);
    bvhlab::bind_reference(module);
    bvhlab::bind_scene(module);
    bvhlab::bind_render(module);
    bvhlab::bind_image(module);
}
