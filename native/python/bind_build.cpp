// SPDX-License-Identifier: GPL-3.0-or-later
// builders, build_tree, Tree, build, Bvh.
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>

#include "base/parallel.h"
#include "build/builder.h"
#include "bvh/collapse.h"
#include "bvh/cost.h"
#include "bvh/validate.h"
#include "python/convert.h"

namespace bvhlab {
namespace {

/// A builder's binary tree, which can be collapsed to any branching factor (class `Tree` in
/// Python).
struct PyTree {
    std::shared_ptr<Mesh> mesh;
    BinaryBvh binary;
    CostModel model;
    std::string builder;
    int threads;
    double seconds;
    BuildLog log;
};

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
    check_device(device);
    check_threads(threads);
    if (!(traversal > 0.0 && traversal < 1e6 && intersection > 0.0 && intersection < 1e6))
        throw py::value_error("traversal and intersection costs must be above 0 and below 1e6");
    const Parameters parameters = check_parameters(builder, parameters_from_python(params));
    const auto token = token_or_new(given_token);

    const py::gil_scoped_release release;
    auto tree = std::make_shared<PyTree>();
    tree->mesh = mesh;
    tree->model = {traversal, intersection};
    tree->builder = builder_id;
    with_threads(threads, [&] {
        tree->threads = thread_count(0);
        const Stopwatch watch;
        tree->binary = builder.build(*mesh, tree->model, parameters, *token, tree->log);
        tree->seconds = watch.seconds();
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
    result->builder = tree.builder;
    result->threads = tree.threads;
    result->tree_seconds = tree.seconds;
    result->log = tree.log;
    with_threads(tree.threads, [&] {
        const Stopwatch watch;
        result->bvh = layout == NodeLayout::cwbvh
                          ? compress(tree.binary, tree.mesh, tree.model, *token)
                          : collapse(tree.binary, tree.mesh, branching, tree.model, *token);
        result->collapse_seconds = watch.seconds();
    });
    return result;
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

py::dict stats(const PyBvh& self) {
    const Bvh& bvh = self.bvh;
    py::dict stats;
    stats["builder"] = self.builder;
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
    stats["build_seconds"] = self.tree_seconds + self.collapse_seconds;
    stats["tree_seconds"] = self.tree_seconds;
    stats["collapse_seconds"] = self.collapse_seconds;
    stats["threads"] = self.threads;
    stats["iterations"] = self.log.steps.empty() ? 0 : self.log.steps.back().iteration;
    stats["ended"] = self.log.ended;
    return stats;
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
        .def(
            "cost", [](const PyTree& self) { return cost(self.binary, self.model); },
            "Eq. 2 before any collapse, one reference per leaf, with the costs it was built for.")
        .def_property_readonly("builder", [](const PyTree& self) { return self.builder; })
        .def_property_readonly("mesh", [](const PyTree& self) { return self.mesh; })
        .def_property_readonly("references",
                               [](const PyTree& self) { return self.binary.reference_count(); })
        .def_property_readonly("seconds", [](const PyTree& self) { return self.seconds; })
        .def_property_readonly(
            "log", [](const PyTree& self) { return log_to_python(self.log); },
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
                               "hold them, unused SIMD lanes included; `bytes` is the sum.")
        .def_property_readonly(
            "log", [](const PyBvh& self) { return log_to_python(self.log); },
            "The binary tree's log, as Tree.log.")
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
        .def_property_readonly("builder", [](const PyBvh& self) { return self.builder; })
        .def_property_readonly("branching", [](const PyBvh& self) { return self.bvh.branching(); })
        .def_property_readonly(
            "layout",
            [](const PyBvh& self) { return node_layout_names[std::size_t(self.bvh.layout())]; },
            "How nodes are stored: \"full\" or \"cwbvh\".");
}

}  // namespace

void check_device(const std::string& device) {
    if (device != "cpu") throw py::value_error("unknown device '" + device + "'; there is cpu");
}

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
        "three triangles to a leaf); hits are the same. Raises ValueError for unknown names and "
        "values out of range, Cancelled after token.cancel().");
}

}  // namespace bvhlab
