// SPDX-License-Identifier: GPL-3.0-or-later
// metrics.
#include "base/parallel.h"
#include "bvh/metrics.h"
#include "python/convert.h"

namespace bvhlab {
namespace {

constexpr std::int64_t most_lines = 1 << 28;

py::dict to_python(const Metrics& metrics) {
    Array<std::uint64_t> leaf_sizes(metrics.shape.leaf_sizes.begin(),
                                    metrics.shape.leaf_sizes.end());
    py::dict dict;
    dict["cost"] = metrics.cost;
    dict["epo"] = metrics.epo;
    dict["leaf_count_mean"] = metrics.leaf_counts.mean;
    dict["leaf_count_deviation"] = metrics.leaf_counts.deviation;
    dict["leaf_count_error"] = metrics.leaf_counts.error;
    dict["max_depth"] = metrics.shape.max_depth;
    dict["mean_leaf_depth"] = metrics.shape.mean_leaf_depth;
    dict["leaf_sizes"] = to_numpy(std::move(leaf_sizes));
    dict["nodes"] = metrics.nodes;
    dict["leaves"] = metrics.leaves;
    dict["references"] = metrics.references;
    dict["bytes"] = metrics.bytes;
    return dict;
}

py::dict measure_bvh(const PyBvh& self, double traversal, double intersection, std::int64_t lines,
                     int threads, const std::shared_ptr<Token>& given_token) {
    check_threads(threads);
    if (!(traversal >= 0.0 && traversal < 1e6 && intersection >= 0.0 && intersection < 1e6))
        throw py::value_error("traversal and intersection costs must be at least 0 and below 1e6");
    if (lines < 2 || lines > most_lines)
        throw py::value_error("lines must be 2 to " + std::to_string(most_lines) + ", not " +
                              std::to_string(lines));
    const auto token = token_or_new(given_token);
    Metrics metrics;
    {
        const py::gil_scoped_release release;
        const CostModel model{traversal, intersection};
        with_threads(threads,
                     [&] { metrics = measure(self.bvh, model, std::size_t(lines), *token); });
    }
    return to_python(metrics);
}

}  // namespace

void bind_metrics(py::module_& module) {
    module.def("metrics", &measure_bvh, py::arg("bvh"), py::arg("traversal") = 3.0,
               py::arg("intersection") = 2.0, py::arg("lines") = 65536, py::arg("threads") = 0,
               py::arg("token") = nullptr,
               R"(Quality of a tree, as a dict.

cost: Eq. 2 or 3. epo: end-point overlap, exact (Aila, Karras, Laine 2013), in the unit of cost.
leaf_count_mean, leaf_count_deviation: how many leaf boxes a uniform random line through the scene
meets, over `lines` full lines of a fixed seed; the deviation is the leaf-count variability, and
leaf_count_error its standard error. max_depth, mean_leaf_depth: interior nodes from the root to a
leaf. leaf_sizes: number of leaves by the references they hold. nodes (interior and leaves), leaves,
references, bytes (nodes and triangle blocks).

EPO is 0 where no triangle has area, leaf counts are 0 where the scene's box has none.
Raises ValueError for a bad argument, Cancelled.)");
}

}  // namespace bvhlab
