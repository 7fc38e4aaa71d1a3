// SPDX-License-Identifier: GPL-3.0-or-later
// builders, build_tree, Tree, build, Bvh.
#include <pybind11/stl.h>

#include <algorithm>
#include <initializer_list>
#include <map>
#include <stdexcept>

#include "base/parallel.h"
#include "build/builder.h"
#include "bvh/collapse.h"
#include "bvh/cost.h"
#include "bvh/validate.h"
#include "python/convert.h"
#include "python/device_calls.h"

namespace bvhlab {
namespace {

// --- arguments -----------------------------------------------------------------------------------

Parameters parameters_from_python(const py::dict& given) {
    Parameters parameters;
    for (const auto& [name, value] : given) {
        if (!py::isinstance<py::str>(name)) throw py::value_error("params must have text keys");
        try {
            parameters[name.cast<std::string>()] = value.cast<double>();
        } catch (const py::cast_error&) {
            throw py::value_error("parameter '" + name.cast<std::string>() + "' must be a number");
        }
    }
    return parameters;
}

void check_branching(unsigned branching) {
    if (branching != 2 && branching != 4 && branching != 8)
        throw py::value_error("branching must be 2, 4 or 8, not " + std::to_string(branching));
}

NodeLayout layout_from_python(const std::string& layout, unsigned branching) {
    check_branching(branching);
    const auto found = std::ranges::find(node_layout_names, layout);
    if (found == node_layout_names.end())
        throw py::value_error("unknown layout '" + layout + "'; there are full and cwbvh");
    const auto chosen = NodeLayout(found - node_layout_names.begin());
    if (chosen == NodeLayout::cwbvh && branching != CompressedBvh::branching)
        throw py::value_error("layout cwbvh has branching 8 only, not " +
                              std::to_string(branching));
    return chosen;
}

// --- calls ---------------------------------------------------------------------------------------

std::shared_ptr<PyTree> build_tree(const std::shared_ptr<Mesh>& mesh, const std::string& builder_id,
                                   const std::string& device, int threads, const py::dict& params,
                                   double traversal, double intersection,
                                   const std::shared_ptr<Token>& given_token) {
    const BuilderInfo& builder = find_builder(builder_id);
    check_threads(threads);
    if (!(traversal > 0.0 && traversal < 1e6 && intersection > 0.0 && intersection < 1e6))
        throw py::value_error("traversal and intersection costs must be above 0 and below 1e6");
    const Parameters parameters = check_parameters(builder, parameters_from_python(params));
    const auto token = token_or_new(given_token);

    const py::gil_scoped_release release;
    auto tree = std::make_shared<PyTree>();
    tree->mesh = mesh;
    tree->model = {traversal, intersection};
    tree->device = device_named(device);
    Origin& origin = tree->origin;
    origin.builder = builder_id;
    with_threads(threads, [&] {
        origin.threads = thread_count(0);
        if (tree->device) return build_on_device(*tree, builder, parameters, *token);
        const Stopwatch watch;
        tree->binary = builder.build(*mesh, tree->model, parameters, *token, origin.log);
        origin.tree.seconds = watch.seconds();
    });
    return tree;
}

std::shared_ptr<PyBvh> collapse_tree(const PyTree& tree, unsigned branching,
                                     const std::string& layout_name,
                                     const std::shared_ptr<Token>& given_token) {
    const NodeLayout layout = layout_from_python(layout_name, branching);
    const auto token = token_or_new(given_token);

    const py::gil_scoped_release release;
    auto result = std::make_shared<PyBvh>();
    Origin& origin = result->origin = tree.origin;
    if (tree.device) {
        result->bvh = collapse_on_device(tree, branching, layout, origin, *token);
        return result;
    }
    with_threads(origin.threads, [&] {
        const Stopwatch watch;
        result->bvh = layout == NodeLayout::cwbvh
                          ? compress(tree.binary, tree.mesh, tree.model, *token)
                          : collapse(tree.binary, tree.mesh, branching, tree.model, *token);
        origin.collapse.seconds = watch.seconds();
    });
    return result;
}

double tree_cost(const PyTree& tree) {
    const py::gil_scoped_release release;
    return tree.device ? cost(downloaded(tree), tree.model) : cost(tree.binary, tree.model);
}

std::shared_ptr<PyBvh> build(const std::shared_ptr<Mesh>& mesh, const std::string& builder,
                             unsigned branching, const std::string& device, int threads,
                             const py::dict& params, double traversal, double intersection,
                             const std::string& layout, const std::shared_ptr<Token>& given_token) {
    find_builder(builder);
    layout_from_python(layout, branching);
    const auto token = token_or_new(given_token);
    const auto tree =
        build_tree(mesh, builder, device, threads, params, traversal, intersection, token);
    return collapse_tree(*tree, branching, layout, token);
}

py::dict log_to_python(const BuildLog& log) {
    py::list steps;
    for (const BuildStep& step : log.steps)
        steps.append(py::make_tuple(step.iteration, step.seconds, step.cost));
    py::dict dict;
    dict["ended"] = log.ended;
    dict["steps"] = steps;
    return dict;
}

/// Seconds of kernels by stage, of all the calls.
py::dict stage_seconds(std::initializer_list<const opencl::CallTimes*> calls) {
    std::map<std::string, double> seconds;
    for (const opencl::CallTimes* call : calls)
        for (const opencl::KernelTime& time : call->device.kernels)
            seconds[time.stage] += time.seconds;
    return py::cast(seconds);
}

/// Every kernel by itself.
py::list kernels_to_python(const opencl::CallTimes& call) {
    py::list list;
    for (const opencl::KernelTime& time : call.device.kernels) {
        py::dict entry;
        entry["stage"] = time.stage;
        entry["kernel"] = time.kernel;
        entry["launches"] = time.launches;
        entry["seconds"] = time.seconds;
        list.append(entry);
    }
    return list;
}

void add_times(py::dict& stats, const Origin& origin) {
    const opencl::CallTimes &tree = origin.tree, &collapse = origin.collapse;
    stats["build_seconds"] = tree.seconds + collapse.seconds;
    stats["tree_seconds"] = tree.seconds;
    stats["collapse_seconds"] = collapse.seconds;
    stats["kernel_seconds"] = stage_seconds({&tree, &collapse});
    stats["transfer_seconds"] = tree.device.transfer_seconds + collapse.device.transfer_seconds;
    stats["program_seconds"] = tree.program_seconds + collapse.program_seconds;
}

py::dict stats(const PyBvh& self) {
    const Bvh& bvh = self.bvh;
    const Origin& origin = self.origin;
    py::dict stats;
    stats["builder"] = origin.builder;
    stats["device"] = origin.device;
    stats["tree_device"] = origin.tree_device;
    stats["branching"] = bvh.branching();
    stats["layout"] = node_layout_names[std::size_t(bvh.layout())];
    stats["nodes"] = bvh.interior_count() + bvh.leaf_count;
    stats["interior_nodes"] = bvh.interior_count();
    stats["leaves"] = bvh.leaf_count;
    stats["references"] = bvh.reference_count;
    stats["max_depth"] = bvh.max_depth;
    stats["max_leaf_size"] = bvh.max_leaf_size;
    stats["average_leaf_size"] = double(bvh.reference_count) / double(bvh.leaf_count);
    stats["bytes"] = bvh.node_bytes() + bvh.leaf_bytes();
    stats["node_bytes"] = bvh.node_bytes();
    stats["leaf_bytes"] = bvh.leaf_bytes();
    add_times(stats, origin);
    stats["threads"] = origin.threads;
    stats["iterations"] = origin.log.steps.empty() ? 0 : origin.log.steps.back().iteration;
    stats["ended"] = origin.log.ended;
    return stats;
}

/// The arrays of nodes and leaves as bytes: views, read-only.
py::list memory(const py::object& self) {
    py::list list;
    const auto add = [&](const auto& array) {
        py::array_t<std::uint8_t> view({py::ssize_t(array.size() * sizeof(array[0]))},
                                       reinterpret_cast<const std::uint8_t*>(array.data()), self);
        view.attr("flags").attr("writeable") = false;
        list.append(view);
    };
    const auto add_all = [&](const auto& tree) {
        add(tree.nodes);
        if constexpr (requires { tree.blocks; }) {
            add(tree.blocks);
        } else {
            add(tree.corners);
            add(tree.triangles);
        }
    };
    std::visit(add_all, self.cast<const PyBvh&>().bvh.tree);
    return list;
}

py::list list_builders() {
    py::list list;
    for (const BuilderInfo& builder : builders()) {
        py::list parameters;
        for (const ParameterInfo& info : builder.parameters) {
            py::dict parameter;
            parameter["name"] = info.name;
            parameter["default"] = info.default_value;
            parameter["minimum"] = info.minimum;
            parameter["maximum"] = info.maximum;
            parameter["integer"] = info.integer;
            parameter["unit"] = info.unit;
            parameter["description"] = info.description;
            parameter["source"] = info.source;
            parameters.append(parameter);
        }
        py::dict entry;
        entry["id"] = builder.id;
        entry["label"] = builder.label;
        entry["source"] = builder.source;
        entry["parameters"] = parameters;
        list.append(entry);
    }
    return list;
}

// --- classes -------------------------------------------------------------------------------------

void bind_tree(py::module_& module) {
    py::class_<PyTree, std::shared_ptr<PyTree>>(
        module, "Tree", "A builder's binary tree with one reference per leaf.")
        .def("collapse", &collapse_tree, py::arg("branching") = 8, py::arg("layout") = "full",
             py::arg("token") = nullptr,
             "A Bvh of branching factor 2, 4 or 8 in layout \"full\", or 8 in layout \"cwbvh\", as "
             "core.build would give it.")
        .def("cost", &tree_cost,
             "Eq. 2 before any collapse, one reference per leaf, with the costs it was built for.")
        .def_property_readonly("builder", [](const PyTree& self) { return self.origin.builder; })
        .def_property_readonly(
            "device", [](const PyTree& self) { return self.origin.device; },
            "Full id of the device that it was built for, and that collapses it.")
        .def_property_readonly(
            "kernels", [](const PyTree& self) { return kernels_to_python(self.origin.tree); },
            "What each kernel of an OpenCL device took: [{\"stage\", \"kernel\", \"launches\", "
            "\"seconds\"}] by its own clock, in order; empty on the cpu.")
        .def_property_readonly("mesh", [](const PyTree& self) { return self.mesh; })
        .def_property_readonly("references",
                               [](const PyTree& self) { return self.reference_count(); })
        .def_property_readonly("seconds",
                               [](const PyTree& self) { return self.origin.tree.seconds; })
        .def_property_readonly(
            "log", [](const PyTree& self) { return log_to_python(self.origin.log); },
            "Of builders that work in iterations: why they `ended`, and `steps` of (iteration, "
            "seconds since the build began, cost of the best tree so far).");
}

void bind_bvh(py::module_& module) {
    py::class_<PyBvh, std::shared_ptr<PyBvh>>(module, "Bvh", "A tree ready to be traced.")
        .def(
            "cost",
            [](const PyBvh& self, double traversal, double intersection) {
                return cost(self.bvh, {traversal, intersection});
            },
            py::arg("traversal") = 3.0, py::arg("intersection") = 2.0,
            "Expected cost of a ray, Eq. 2 of the paper (branching 2) or Eq. 3 (4 and 8), of the "
            "boxes as stored. Eq. 3 charges the tests of a leaf rounded up to a multiple of the "
            "branching factor, as its triangles fill SIMD lanes. In layout cwbvh each triangle is "
            "charged by itself, as by Ylitie et al. 2017, and boxes count as they decode: costs of "
            "different layouts are not comparable.")
        .def_property_readonly("stats", &stats,
                               "Sizes, counts and build times in seconds; for builders that work "
                               "in iterations how many, and why they `ended`. `node_bytes` are "
                               "those of interior nodes, `leaf_bytes` those of triangles as leaves "
                               "hold them, unused SIMD lanes included; `bytes` is the sum. "
                               "On OpenCL devices: `tree_device` is \"cpu\" where the CPU core "
                               "makes the binary tree (sah, sbvh, hybrid); build times are by the "
                               "wall clock from the first command to the last, but for "
                               "`transfer_seconds` (copies) and `program_seconds` (building "
                               "programs); `kernel_seconds` by stage and copies are by the "
                               "device's clock.")
        .def_property_readonly(
            "log", [](const PyBvh& self) { return log_to_python(self.origin.log); },
            "The binary tree's log, as Tree.log.")
        .def_property_readonly(
            "device", [](const PyBvh& self) { return self.origin.device; },
            "Full id of the device that built it; any can trace it.")
        .def_property_readonly(
            "collapse_kernels",
            [](const PyBvh& self) { return kernels_to_python(self.origin.collapse); },
            "Of collapse and layout, as Tree.kernels.")
        .def_property_readonly("memory", &memory,
                               "What rays traverse, as [(N,) uint8], read-only: nodes, then "
                               "triangles. Equal trees have equal bytes, whatever device made "
                               "them.")
        .def(
            "validate",
            [](const PyBvh& self) {
                const py::gil_scoped_release release;
                try {
                    validate(self.bvh);
                } catch (const std::logic_error& error) {
                    throw std::runtime_error(error.what());
                }
            },
            "Raises RuntimeError with the first broken invariant.")
        .def_property_readonly(
            "mesh", [](const PyBvh& self) { return std::const_pointer_cast<Mesh>(self.bvh.mesh); })
        .def_property_readonly("builder", [](const PyBvh& self) { return self.origin.builder; })
        .def_property_readonly("branching", [](const PyBvh& self) { return self.bvh.branching(); })
        .def_property_readonly(
            "layout",
            [](const PyBvh& self) { return node_layout_names[std::size_t(self.bvh.layout())]; },
            "How nodes are stored: \"full\" or \"cwbvh\".");
}

}  // namespace

void bind_build(py::module_& module) {
    bind_tree(module);
    bind_bvh(module);
    module.def("builders", &list_builders, "The builders there are, with their parameters.");
    module.def("build_tree", &build_tree, py::arg("mesh"), py::arg("builder"),
               py::arg("device") = "cpu", py::arg("threads") = 0, py::arg("params") = py::dict(),
               py::arg("traversal") = 3.0, py::arg("intersection") = 2.0,
               py::arg("token") = nullptr,
               "Builds a binary tree, to be collapsed to several branching factors. Raises as "
               "build does.");
    module.def(
        "build", &build, py::arg("mesh"), py::arg("builder"), py::arg("branching") = 8,
        py::arg("device") = "cpu", py::arg("threads") = 0, py::arg("params") = py::dict(),
        py::arg("traversal") = 3.0, py::arg("intersection") = 2.0, py::arg("layout") = "full",
        py::arg("token") = nullptr,
        "Builds a tree. `layout` is \"full\" (floats, 32 bytes a child) or, for branching 8, "
        "\"cwbvh\" (80-byte nodes of Ylitie, Karras, Laine 2017: boxes quantised outward, at most "
        "three triangles to a leaf); hits are the same. `device` is as of trace(), and the tree is "
        "the same from each. Raises ValueError for unknown names and values out of range, "
        "RuntimeError and MemoryError as trace(), Cancelled after token.cancel().");
}

}  // namespace bvhlab
