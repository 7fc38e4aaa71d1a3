// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "opencl/commands.h"
#include "opencl/device_tree.h"

namespace bvhlab::opencl {

/// How threads share the work of tracing. All give the same hits.
enum class TraceShape {
    automatic,  ///< by device: on a GPU `measured`, else `single`
    measured,   ///< the fastest on the first rays that are traced, kept for device and kind of tree
    single,     ///< one thread per ray: any tree
    persistent,  ///< binary: persistent threads, dynamic fetch, a postponed leaf (Aila, Laine 2009)
    lanes,       ///< 4- and 8-wide: a thread per child (Lier, Stamminger, Selgrad 2018)
    octant,      ///< cwbvh: children in the order of the ray's octant (Ylitie, Karras, Laine 2017)
};
inline constexpr std::array<const char*, 6> trace_shape_names{"automatic",  "measured", "single",
                                                              "persistent", "lanes",    "octant"};

/// The shapes that can trace a tree, `single` first.
std::vector<TraceShape> shapes_for(const DeviceTree& tree);

/// What runs a shape.
struct TraceKernel {
    ProgramSource source;
    const char* name;
    std::size_t group;  ///< work-items of a group; 0: as Commands has it
    unsigned threads;   ///< per ray
    bool fetches;       ///< takes rays from a counter: any number of threads will do
    std::size_t stack;  ///< entries that a ray has without spilling
};

/// `shape` is one of shapes_for(tree). Its threads talk by sub-groups where `commands` has it so
/// and they are of a size that serves.
TraceKernel kernel_of(Commands& commands, const DeviceTree& tree, TraceShape shape, bool any_hit);

/// The kernel for rays that the others leave undecided, and for counting.
TraceKernel careful_kernel_of(bool suits_gpu, const DeviceTree& tree);

}  // namespace bvhlab::opencl
