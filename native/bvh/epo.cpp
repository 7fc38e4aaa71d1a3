// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/epo.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <numeric>
#include <vector>

#include "base/parallel.h"
#include "bvh/polygon.h"
#include "bvh/subtrees.h"

namespace bvhlab {
namespace {

/// The leaves that refer to each triangle. Leaves are numbered depth-first, so those below a node
/// are consecutive, and whether a triangle is in it takes one look at the triangle's sorted leaves.
struct Homes {
    Array<std::uint32_t> first;  ///< into leaves, by triangle, and the end
    Array<std::uint32_t> leaves;
};

/// Calls `visit(triangle, leaf)` for every reference of the tree.
template <class Tree, class Visit>
void for_each_reference(const Tree& wide, const Subtrees& below, const Token& token,
                        Visit&& visit) {
    constexpr unsigned k = Tree::branching;
    Array<std::uint32_t> first_leaf(wide.nodes.size());
    first_leaf[0] = 0;
    for (std::size_t node = 0; node < wide.nodes.size(); ++node) {
        if (node % 4096 == 0) token.check();
        const WideNode<k>& parent = wide.node(node);
        std::uint32_t leaf = first_leaf[node];
        for (unsigned i = 0; i < k && !parent.is_missing(i); ++i) {
            const std::uint32_t child = parent.child[i];
            if (!parent.is_leaf(i)) {
                first_leaf[child] = leaf;
                leaf += below.leaves[child];
                continue;
            }
            for (std::uint32_t n = 0; n < parent.count[i]; ++n)
                visit(wide.reference(child, n), leaf);
            ++leaf;
        }
    }
}

template <class Tree>
Homes find_homes(const Tree& wide, const Subtrees& below, std::size_t triangles,
                 const Token& token) {
    Homes homes{Array<std::uint32_t>(triangles + 1, 0), {}};
    for_each_reference(wide, below, token,
                       [&](std::uint32_t triangle, std::uint32_t) { ++homes.first[triangle]; });
    std::inclusive_scan(homes.first.begin(), homes.first.end(), homes.first.begin());
    homes.leaves.resize(homes.first.back());
    for_each_reference(wide, below, token, [&](std::uint32_t triangle, std::uint32_t leaf) {
        homes.leaves[--homes.first[triangle]] = leaf;
    });
    parallel_for_each(triangles, 4096, token, [&](std::size_t triangle) {
        std::sort(homes.leaves.begin() + homes.first[triangle],
                  homes.leaves.begin() + homes.first[triangle + 1]);
    });
    return homes;
}

/// Takes one triangle after the other down the tree.
template <class Tree>
class Descent {
public:
    Descent(const Tree& wide, const Subtrees& below, const Homes& homes, const CostModel& model,
            const Token& token)
        : wide_(wide), below_(below), homes_(homes), model_(model), token_(token) {}

    /// Sum over the nodes that the triangle is not in of C_n times twice its area in their boxes.
    double overlap(const Mesh& mesh, std::uint32_t triangle) {
        set_polygon(polygon_, mesh.triangle(triangle));
        const double area = doubled_area(polygon_);
        if (!(area > 0.0)) return 0.0;
        sum_ = 0.0;
        push({0, 0, homes_.first[triangle], homes_.first[triangle + 1], area, {}}, polygon_);
        while (!pending_.empty()) {
            if (++visits_ % 1024 == 0) token_.check();
            visit(pop());
        }
        return sum_;
    }

private:
    static constexpr unsigned k = Tree::branching;

    /// A node that the triangle reaches into. Its part inside the box is on top of `corners_`.
    struct Visit {
        std::uint32_t node, first_leaf;
        std::uint32_t home, home_end;  ///< the triangle's leaves below the node
        double area;                   ///< of the part, twice
        std::size_t corner;            ///< of the part, the first in `corners_`
    };

    void push(Visit visit, const Polygon& part) {
        visit.corner = corners_.size();
        corners_.insert(corners_.end(), part.begin(), part.end());
        pending_.push_back(visit);
    }

    Visit pop() {
        const Visit visit = pending_.back();
        pending_.pop_back();
        polygon_.assign(corners_.begin() + std::ptrdiff_t(visit.corner), corners_.end());
        corners_.resize(visit.corner);
        return visit;
    }

    void visit(const Visit& at) {
        const WideNode<k>& node = wide_.node(at.node);
        const Extent reach = extent(polygon_);
        std::uint32_t leaf = at.first_leaf, home = at.home;
        for (unsigned i = 0; i < k && !node.is_missing(i); ++i) {
            const std::uint32_t child = node.child[i];
            Visit next{child, leaf, home, home, at.area, {}};
            leaf += node.is_leaf(i) ? 1 : below_.leaves[child];
            while (home < at.home_end && homes_.leaves[home] < leaf) ++home;
            next.home_end = home;
            if (reach.meets(node.box(i))) enter(node, i, next, reach);
        }
    }

    void enter(const WideNode<k>& node, unsigned i, Visit& next, const Extent& reach) {
        const bool is_in = next.home != next.home_end;
        if (is_in && node.is_leaf(i)) return;
        const Polygon* part = &polygon_;
        if (const Box box = node.box(i); !reach.is_in(box)) {
            clipped_ = polygon_;
            if (!clip_polygon(clipped_, reach, box, spare_)) return;
            next.area = doubled_area(clipped_);
            if (!(next.area > 0.0)) return;
            part = &clipped_;
        }
        if (!is_in && !node.is_leaf(i) && extent(*part).is_in(below_.common[next.node])) {
            sum_ += below_.work[next.node] * next.area;
            return;
        }
        if (!is_in) sum_ += node_work<Tree>(node, i, model_) * next.area;
        if (!node.is_leaf(i)) push(next, *part);
    }

    const Tree& wide_;
    const Subtrees& below_;
    const Homes& homes_;
    const CostModel& model_;
    const Token& token_;
    double sum_ = 0.0;
    std::size_t visits_ = 0;
    std::vector<Visit> pending_;
    Polygon corners_;                    // parts of the pending visits, one after the other
    Polygon polygon_, clipped_, spare_;  // polygon_: the part in the node being visited
};

template <class Tree>
double overlap_of(const Mesh& mesh, const Tree& wide, const CostModel& model, Token& token) {
    const Subtrees below = find_subtrees(wide, model, token);
    const Homes homes = find_homes(wide, below, mesh.size(), token);

    struct Sums {
        double overlap = 0.0, area = 0.0;

        Sums operator+(const Sums& other) const {
            return {overlap + other.overlap, area + other.area};
        }
    };
    std::atomic<std::size_t> done = 0;
    const auto add = [&](const IndexRange& triangles, Sums sums) {
        token.check();
        Descent<Tree> descent(wide, below, homes, model, token);
        Polygon corners;
        for (std::size_t triangle = triangles.begin(); triangle < triangles.end(); ++triangle) {
            set_polygon(corners, mesh.triangle(triangle));
            sums.area += doubled_area(corners);
            sums.overlap += descent.overlap(mesh, std::uint32_t(triangle));
        }
        token.advance(float(done += triangles.size()) / float(mesh.size()));
        return sums;
    };
    constexpr std::size_t grain = 256;
    const Sums sums = parallel_sum(0, mesh.size(), grain, Sums{}, add);
    return sums.area > 0.0 ? sums.overlap / sums.area : 0.0;
}

}  // namespace

double end_point_overlap(const Bvh& bvh, const CostModel& model, Token& token) {
    token.begin("measuring end-point overlap");
    const double overlap = std::visit(
        [&](const auto& wide) { return overlap_of(*bvh.mesh, wide, model, token); }, bvh.tree);
    token.advance(1.0F);
    return overlap;
}

}  // namespace bvhlab
