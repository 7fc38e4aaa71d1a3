// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/treelet.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "bvh/leaf_first_order.h"

namespace bvhlab {

Treelet form_treelet(const BinaryBvh& bvh, std::uint32_t root, unsigned size) {
    constexpr double closed = -1.0;  // of a leaf, which cannot be opened
    std::array<double, max_treelet_size> areas;
    Treelet treelet;
    treelet.size = size;
    treelet.area = 0.0;

    const auto put = [&](unsigned place, std::uint32_t node) {
        treelet.leaves[place] = node;
        areas[place] = closed;
        if (bvh.is_leaf(node)) return;
        areas[place] = bvh.boxes[node].half_area();
        const auto [left, right] = bvh.children[node];  // may be put soon
        __builtin_prefetch(&bvh.boxes[left]);
        __builtin_prefetch(&bvh.boxes[right]);
    };
    treelet.interior[0] = root;
    put(0, bvh.children[root].left);
    put(1, bvh.children[root].right);
    for (unsigned count = 2; count < size; ++count) {
        const unsigned largest =
            unsigned(std::max_element(areas.begin(), areas.begin() + count) - areas.begin());
        const std::uint32_t node = treelet.leaves[largest];
        treelet.area += areas[largest];
        treelet.interior[count - 1] = node;
        put(largest, bvh.children[node].left);
        put(count, bvh.children[node].right);
    }
    return treelet;
}

void measure(const BinaryBvh& bvh, const Treelet& treelet, Topology& topology) {
    const auto box = [&](unsigned part) -> const Box& {
        return part < treelet.size ? bvh.boxes[treelet.leaves[part]]
                                   : topology.boxes[part - treelet.size];
    };
    topology.area = 0.0;
    for (unsigned i = 0; i + 1 < treelet.size; ++i) {
        topology.boxes[i] = unite(box(topology.merges[i].left), box(topology.merges[i].right));
        if (i + 2 < treelet.size) topology.area += topology.boxes[i].half_area();
    }
}

Array<std::uint32_t> reference_counts(const BinaryBvh& bvh, const Token& token) {
    Array<std::uint32_t> counts(bvh.children.size());
    const auto count = [&](std::uint32_t node) { return bvh.is_leaf(node) ? 1 : counts[node]; };
    for_each_leaf_first(bvh, token, [&](std::uint32_t node) {
        counts[node] = count(bvh.children[node].left) + count(bvh.children[node].right);
    });
    return counts;
}

void replace(BinaryBvh& bvh, Array<std::uint32_t>& counts, const Treelet& treelet,
             const Topology& topology) {
    const unsigned last = treelet.size - 2;  // makes the root, which keeps its place
    const auto made = [&](unsigned merge) {
        return treelet.interior[merge == last ? 0 : merge + 1];
    };
    const auto node = [&](unsigned part) {
        return part < treelet.size ? treelet.leaves[part] : made(part - treelet.size);
    };
    const auto count = [&](std::uint32_t id) { return bvh.is_leaf(id) ? 1 : counts[id]; };
    for (unsigned i = 0; i <= last; ++i) {
        const std::uint32_t left = node(topology.merges[i].left);
        const std::uint32_t right = node(topology.merges[i].right);
        bvh.children[made(i)] = {left, right};
        bvh.boxes[made(i)] = topology.boxes[i];
        counts[made(i)] = count(left) + count(right);
    }
}

namespace {

/// Nodes of at least gamma references, level by level from the root.
struct Levels {
    std::vector<std::uint32_t> nodes;
    std::vector<std::size_t> begins;  ///< of each level in `nodes`, and the end
};

Levels find_levels(const BinaryBvh& bvh, const Array<std::uint32_t>& counts, std::size_t gamma,
                   const Token& token) {
    Levels levels{{0}, {0, 1}};
    while (true) {
        token.check();
        const std::size_t begin = levels.begins.end()[-2], end = levels.begins.back();
        for (std::size_t i = begin; i < end; ++i) {
            const auto [left, right] = bvh.children[levels.nodes[i]];
            for (const std::uint32_t child : {left, right})
                if (!bvh.is_leaf(child) && counts[child] >= gamma) levels.nodes.push_back(child);
        }
        if (levels.nodes.size() == end) return levels;
        levels.begins.push_back(levels.nodes.size());
    }
}

/// One pass, from the lowest level up: nodes of a level have no other of them below.
class Pass {
public:
    Pass(Levels levels, const std::function<double(std::uint32_t)>& restructure,
         const std::function<bool()>& out_of_time)
        : levels_(std::move(levels)),
          savings_(levels_.nodes.size(), 0.0),
          restructure_(restructure),
          out_of_time_(out_of_time) {}

    /// Returns the area saved. Nodes are left as they are once time is out.
    double run(Token& token, float fraction_begin, float fraction_end) {
        for (std::size_t level = levels_.begins.size() - 1; level-- > 0 && !out_of_time_();) {
            const std::size_t begin = levels_.begins[level], end = levels_.begins[level + 1];
            run_level(begin, end, token);
            const float left = float(begin) / float(levels_.nodes.size());
            token.advance(fraction_end + (fraction_begin - fraction_end) * left);
        }
        return std::accumulate(savings_.begin(), savings_.end(), 0.0);
    }

private:
    static constexpr std::size_t grain = 8;  // treelets to a task, a few microseconds each

    void run_level(std::size_t begin, std::size_t end, const Token& token) {
        const std::size_t tasks = (end - begin + grain - 1) / grain;
        const auto run_task = [&](std::size_t task) {
            token.check();
            if (out_of_time_()) return;
            const std::size_t first = begin + task * grain;
            for (std::size_t i = first; i < std::min(end, first + grain); ++i)
                savings_[i] = restructure_(levels_.nodes[i]);
        };
        if (tasks == 1)
            run_task(0);  // a deep tree has as many levels as nodes
        else
            parallel_for_each(tasks, 1, token, run_task);
    }

    Levels levels_;
    std::vector<double> savings_;  // by node: added up in an order that no thread changes
    const std::function<double(std::uint32_t)>& restructure_;
    const std::function<bool()>& out_of_time_;
};

}  // namespace

void restructure_treelets(BinaryBvh& bvh, const Array<std::uint32_t>& counts,
                          const RestructuringLimits& limits, const CostModel& model,
                          const Stopwatch& watch, Token& token, BuildLog& log,
                          const std::function<double(std::uint32_t root)>& restructure) {
    const std::function<bool()> out_of_time = [&] {
        return limits.max_seconds > 0.0 && watch.seconds() >= limits.max_seconds;
    };
    const double root_area = bvh.boxes[0].half_area();
    double tree_cost = cost(bvh, model);
    const auto report = [&](std::uint32_t iteration) {
        log.steps.push_back({iteration, watch.seconds(), tree_cost});
        token.report_cost(tree_cost);
    };
    report(0);

    std::size_t gamma = limits.treelet_size;
    float left = 1.0F;  // of the work: a pass has about half as many treelets as the one before
    log.ended = "converged";
    for (std::uint32_t iteration = 1; gamma <= bvh.reference_count(); ++iteration) {
        if (iteration > limits.iterations) {
            log.ended = "iteration limit";
            break;
        }
        Pass pass(find_levels(bvh, counts, gamma, token), restructure, out_of_time);
        const double saved = pass.run(token, 1.0F - left, 1.0F - 0.5F * left);
        if (root_area > 0.0) tree_cost -= model.traversal * saved / root_area;
        report(iteration);
        if (out_of_time()) {
            log.ended = "time limit";
            break;
        }
        gamma *= 2;
        left *= 0.5F;
    }
    token.advance(1.0F);
}

}  // namespace bvhlab
