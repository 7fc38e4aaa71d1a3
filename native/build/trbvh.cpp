// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/trbvh.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <limits>

#include "build/lbvh.h"
#include "bvh/depth_first.h"
#include "bvh/leaf_first_order.h"

namespace bvhlab {
namespace {

constexpr unsigned largest_treelet = 8;
constexpr unsigned set_count = 1U << largest_treelet;

consteval unsigned binomial(unsigned n, unsigned k) {
    return k == 0 ? 1 : n < k ? 0 : binomial(n - 1, k - 1) + binomial(n - 1, k);
}

/// All sets of `Size` treelet leaves, each with all ways to divide it in two. A set is a number
/// with a bit per leaf; a division is named by the part that has the set's first leaf, the other is
/// what remains. A smaller treelet has the first of these sets.
template <unsigned Size>
struct Divisions {
    static constexpr unsigned per_set = (1U << (Size - 1)) - 1;

    std::uint8_t sets[binomial(largest_treelet, Size)] = {};
    std::uint8_t parts[binomial(largest_treelet, Size)][per_set] = {};

    constexpr Divisions() {
        unsigned end = 0;
        for (unsigned set = 1; set < set_count; ++set) {
            if (std::popcount(set) != Size) continue;
            sets[end] = std::uint8_t(set);
            const unsigned first = set & -set, others = set ^ first;
            unsigned part = others;
            for (std::uint8_t& division : parts[end]) {
                part = (part - 1) & others;
                division = std::uint8_t(first | part);
            }
            ++end;
        }
    }
};

template <unsigned Size>
constexpr Divisions<Size> divisions;

/// What there is to know of each set of a treelet's leaves, by set. Costs are in units of area.
struct Sets {
    alignas(64) float lower[3][set_count];
    alignas(64) float upper[3][set_count];
    double references[set_count];
    double as_leaf[set_count];
    double as_node[set_count];  ///< of the node alone
    double cost[set_count];     ///< the least, with all that is below
};

/// The least cost of all divisions of the `index`-th set.
template <unsigned Size>
double least_division(const Sets& sets, unsigned index) {
    const unsigned set = divisions<Size>.sets[index];
    double least = std::numeric_limits<double>::infinity();
    for (const unsigned part : divisions<Size>.parts[index]) {
        const double cost = sets.cost[part] + sets.cost[set ^ part];
        least = cost < least ? cost : least;
    }
    return least;
}

/// The dynamic programme (Karras and Aila 2013) for all sets of two or
/// more of the treelet's leaves, the smaller sets first.
template <unsigned Size = 2>
void find_costs(Sets& sets, unsigned treelet_size) {
    for (unsigned index = 0; index < std::size(divisions<Size>.sets); ++index) {
        const unsigned set = divisions<Size>.sets[index];
        if (set >> treelet_size != 0) break;
        const double as_node = sets.as_node[set] + least_division<Size>(sets, index);
        sets.cost[set] = std::min(as_node, sets.as_leaf[set]);
    }
    if constexpr (Size < largest_treelet) find_costs<Size + 1>(sets, treelet_size);
}

/// The part of a set's best division that has the set's first leaf.
unsigned best_part(const Sets& sets, unsigned set) {
    const unsigned first = set & -set, others = set ^ first;
    unsigned best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (unsigned part = others; part != 0;) {
        part = (part - 1) & others;
        const double cost = sets.cost[first | part] + sets.cost[others ^ part];
        if (cost < least) {
            least = cost;
            best = first | part;
        }
    }
    return best;
}

/// Appends the merges that make a set's best topology; returns the part that the set becomes.
/// Recurses no deeper than the treelet.
unsigned divide(const Sets& sets, unsigned set, unsigned treelet_size, Topology& topology,
                unsigned& made) {
    if (std::has_single_bit(set)) return unsigned(std::countr_zero(set));
    const unsigned part = best_part(sets, set);
    const unsigned left = divide(sets, part, treelet_size, topology, made);
    const unsigned right = divide(sets, set ^ part, treelet_size, topology, made);
    topology.merges[made] = {std::uint8_t(left), std::uint8_t(right)};
    return treelet_size + made++;
}

/// The tree on its way, with the cost of each subtree after leaves are collapsed, in units of area.
class Restructuring {
public:
    Restructuring(BinaryBvh& bvh, Array<std::uint32_t>& counts, const CostModel& model,
                  unsigned treelet_size, const Token& token)
        : bvh_(bvh),
          counts_(counts),
          model_(model),
          treelet_size_(treelet_size),
          costs_(counts.size()) {
        for_each_leaf_first(bvh, token, [&](std::uint32_t node) { update_cost(node); });
    }

    /// Gives the treelet at `root` its best topology. Returns by how much the areas of its interior
    /// nodes shrank.
    double restructure(std::uint32_t root) {
        update_cost(root);
        const Treelet treelet = form_treelet(bvh_, root, treelet_size_);
        Sets sets;
        load(treelet, sets);
        find_costs(sets, treelet_size_);
        const unsigned all = (1U << treelet_size_) - 1;
        if (!(sets.cost[all] < costs_[root])) return 0.0;

        Topology topology;
        unsigned made = 0;
        divide(sets, all, treelet_size_, topology, made);
        measure(bvh_, treelet, topology);
        replace(bvh_, counts_, treelet, topology);
        for (unsigned i = 1; i < made; ++i) update_cost(treelet.interior[i]);
        update_cost(root);
        return treelet.area - topology.area;
    }

private:
    std::uint32_t count(std::uint32_t node) const { return bvh_.is_leaf(node) ? 1 : counts_[node]; }

    double cost(std::uint32_t node) const {
        return bvh_.is_leaf(node) ? model_.intersection * bvh_.boxes[node].half_area()
                                  : costs_[node];
    }

    /// The lesser of a node over its children and of a leaf.
    void update_cost(std::uint32_t node) {
        const auto [left, right] = bvh_.children[node];
        const double area = bvh_.boxes[node].half_area();
        costs_[node] = std::min(model_.traversal * area + (cost(left) + cost(right)),
                                model_.intersection * area * double(counts_[node]));
    }

    /// A leaf has the references of its set, not of the whole treelet.
    void load(const Treelet& treelet, Sets& sets) const {
        const Box none = Box::empty();
        for (int axis = 0; axis < 3; ++axis) {
            sets.lower[axis][0] = none.lower[axis];
            sets.upper[axis][0] = none.upper[axis];
        }
        sets.references[0] = 0.0;
        for (unsigned leaf = 0; leaf < treelet_size_; ++leaf) {
            const unsigned single = 1U << leaf;
            const Box& box = bvh_.boxes[treelet.leaves[leaf]];
            for (int axis = 0; axis < 3; ++axis) {
                add_leaf(sets.lower[axis], single, box.lower[axis],
                         [](float a, float b) { return a < b ? a : b; });
                add_leaf(sets.upper[axis], single, box.upper[axis],
                         [](float a, float b) { return a > b ? a : b; });
            }
            add_leaf(sets.references, single, double(count(treelet.leaves[leaf])), std::plus<>());
            sets.cost[single] = cost(treelet.leaves[leaf]);
        }
        for (unsigned set = 1; set < 1U << treelet_size_; ++set) {
            const double x = double(sets.upper[0][set]) - double(sets.lower[0][set]);
            const double y = double(sets.upper[1][set]) - double(sets.lower[1][set]);
            const double z = double(sets.upper[2][set]) - double(sets.lower[2][set]);
            const double area = x * y + y * z + z * x;  // as Box::half_area
            sets.as_node[set] = model_.traversal * area;
            sets.as_leaf[set] = model_.intersection * area * sets.references[set];
        }
    }

    /// Fills in the values of all sets with this leaf and no later one, from those without it.
    template <class Value, class Combine>
    static void add_leaf(Value* values, unsigned single, Value value, Combine&& combine) {
        Value* with_leaf = values + single;
        for (unsigned set = 0; set < single; ++set) with_leaf[set] = combine(value, values[set]);
    }

    BinaryBvh& bvh_;
    Array<std::uint32_t>& counts_;
    const CostModel& model_;
    unsigned treelet_size_;
    Array<double> costs_;  // by interior node
};

}  // namespace

TrbvhConfig trbvh_config(const Parameters& parameters) {
    const auto value = [&](std::string_view name) { return parameters.find(name)->second; };
    return {.treelet_size = int(value("treelet_size")),
            .iterations = int(value("iterations")),
            .max_seconds = value("max_seconds")};
}

BinaryBvh build_trbvh(const Mesh& mesh, const CostModel& model, const TrbvhConfig& config,
                      Token& token, BuildLog& log) {
    token.begin("building TRBVH");
    const Stopwatch watch;
    Token base_token(&token);
    BinaryBvh bvh = build_lbvh(mesh, base_token);
    Array<std::uint32_t> counts = reference_counts(bvh, token);
    Restructuring restructuring(bvh, counts, model, unsigned(config.treelet_size), token);

    const RestructuringLimits limits{.treelet_size = std::uint32_t(config.treelet_size),
                                     .iterations = std::uint32_t(config.iterations),
                                     .max_seconds = config.max_seconds};
    restructure_treelets(bvh, counts, limits, model, watch, token, log,
                         [&](std::uint32_t root) { return restructuring.restructure(root); });
    return depth_first(bvh, token);
}

}  // namespace bvhlab
