// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/validate.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

namespace bvhlab {
namespace {

[[noreturn]] void broken(const std::string& what) {
    throw std::logic_error("invalid BVH: " + what);
}

std::string number(std::size_t value) {
    return std::to_string(value);
}

void check_finite(const Box& box, const std::string& where) {
    for (int axis = 0; axis < 3; ++axis) {
        if (!std::isfinite(box.lower[axis]) || !std::isfinite(box.upper[axis]))
            broken(where + " has a box that is not finite");
        if (box.lower[axis] > box.upper[axis]) broken(where + " has an empty box");
    }
}

/// Which corners of each triangle were seen in a box of one of its references, and whether it was
/// seen at all.
class Coverage {
public:
    explicit Coverage(const Mesh& mesh) : mesh_(mesh), seen_(mesh.size(), 0) {}

    void see(std::uint32_t triangle, const Box& box) {
        if (triangle >= mesh_.size()) broken("a leaf refers to triangle " + number(triangle));
        const Triangle t = mesh_.triangle(triangle);
        seen_[triangle] |= std::uint8_t(8 | contains(box, t.a) | contains(box, t.b) << 1 |
                                        contains(box, t.c) << 2);
    }

    void check_complete() const {
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            if (seen_[i] == 0) broken("no leaf refers to triangle " + number(i));
            if (seen_[i] != 15) broken("no leaf box holds a corner of triangle " + number(i));
        }
    }

private:
    static int contains(const Box& box, const glm::vec3& point) {
        return box.contains(Box{point, point}) ? 1 : 0;
    }

    const Mesh& mesh_;
    std::vector<std::uint8_t> seen_;
};

/// Breadth-first check of one wide tree: in this layout every child stands behind its parent and
/// interior children are numbered in the order in which they are met, which also proves that each
/// is visited once.
template <unsigned K>
class WideValidator {
public:
    WideValidator(const Bvh& bvh, const WideBvh<K>& wide)
        : bvh_(bvh), wide_(wide), coverage_(*bvh.mesh), depth_(wide.nodes.size(), 0) {}

    void run() {
        if (wide_.nodes.empty()) broken("there is no root");
        depth_[0] = 1;
        for (std::size_t node = 0; node < wide_.nodes.size(); ++node) check_node(node);
        if (next_child_ != wide_.nodes.size()) broken("some nodes are no node's child");
        if (next_block_ != wide_.blocks.size()) broken("some triangle blocks are in no leaf");
        if (references_ != bvh_.reference_count) broken("the stored reference count is wrong");
        if (leaves_ != bvh_.leaf_count) broken("the stored leaf count is wrong");
        if (largest_leaf_ != bvh_.max_leaf_size) broken("the stored largest leaf is wrong");
        if (*std::ranges::max_element(depth_) != bvh_.max_depth)
            broken("the stored depth is wrong");
        coverage_.check_complete();
    }

private:
    void check_node(std::size_t index) {
        const WideNode<K>& node = wide_.nodes[index];
        bool missing = false;
        for (unsigned i = 0; i < K; ++i) {
            const std::string where = "child " + number(i) + " of node " + number(index);
            if (node.is_missing(i)) {
                missing = true;
                if (node.child[i] != 0 || node.count[i] != 0) broken(where + " is half missing");
                continue;
            }
            if (missing) broken(where + " comes after a missing child");
            check_finite(node.box(i), where);
            if (node.is_leaf(i))
                check_leaf(node, i, where);
            else
                check_interior(index, i, where);
        }
        if (node.is_missing(0)) broken("node " + number(index) + " has no children");
    }

    void check_interior(std::size_t index, unsigned i, const std::string& where) {
        const WideNode<K>& parent = wide_.nodes[index];
        if (parent.child[i] != next_child_ || next_child_ >= wide_.nodes.size())
            broken(where + " is not the next node in breadth-first order");
        const WideNode<K>& child = wide_.nodes[next_child_];
        for (unsigned j = 0; j < K; ++j)
            if (!child.is_missing(j) && !parent.box(i).contains(child.box(j)))
                broken("the box of " + where + " does not contain the boxes below it");
        depth_[next_child_++] = depth_[index] + 1;
    }

    void check_leaf(const WideNode<K>& node, unsigned i, const std::string& where) {
        constexpr unsigned lanes = WideBvh<K>::lanes;
        const std::size_t blocks = (std::size_t(node.count[i]) + lanes - 1) / lanes;
        if (node.child[i] != next_block_ || next_block_ + blocks > wide_.blocks.size())
            broken("the blocks of " + where + " do not follow those of the leaf before it");
        for (std::size_t lane = 0; lane < blocks * lanes; ++lane)
            check_lane(wide_.blocks[next_block_ + lane / lanes], unsigned(lane % lanes),
                       lane < node.count[i], node.box(i), where);
        next_block_ += blocks;
        references_ += node.count[i];
        largest_leaf_ = std::max<std::size_t>(largest_leaf_, node.count[i]);
        ++leaves_;
    }

    void check_lane(const TriangleBlock<WideBvh<K>::lanes>& block, unsigned lane, bool used,
                    const Box& box, const std::string& where) {
        const std::uint32_t index = block.triangle[lane];
        if (!used) {
            if (index != no_triangle) broken("an unused lane of " + where + " holds a triangle");
            return;
        }
        coverage_.see(index, box);
        const Triangle t = bvh_.mesh->triangle(index);
        const glm::vec3* corners[3] = {&t.a, &t.b, &t.c};
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis)
                if (block.corners[corner][axis][lane] != (*corners[corner])[axis])
                    broken("a triangle of " + where + " is not the mesh's");
    }

    const Bvh& bvh_;
    const WideBvh<K>& wide_;
    Coverage coverage_;
    std::vector<std::size_t> depth_;
    std::size_t next_child_ = 1, next_block_ = 0, references_ = 0, leaves_ = 0, largest_leaf_ = 0;
};

}  // namespace

void validate(const Bvh& bvh) {
    std::visit([&]<unsigned K>(const WideBvh<K>& wide) { WideValidator<K>(bvh, wide).run(); },
               bvh.tree);
}

void validate(const BinaryBvh& bvh, const Mesh& mesh) {
    const std::size_t references = bvh.references.size();
    if (references == 0 || bvh.boxes.size() != 2 * references - 1 ||
        bvh.children.size() != references - 1)
        broken("the array sizes do not fit a binary tree");
    std::vector<std::uint8_t> seen(bvh.node_count(), 0);
    seen[0] = 1;
    for (std::uint32_t node = 0; node < bvh.children.size(); ++node) {
        for (const std::uint32_t child : {bvh.children[node].left, bvh.children[node].right}) {
            if (child >= bvh.node_count()) broken("node " + number(node) + " has no such child");
            if (seen[child]++) broken("node " + number(child) + " is a child twice");
            if (!bvh.boxes[node].contains(bvh.boxes[child]))
                broken("the box of node " + number(node) + " does not contain its child");
        }
    }
    // Each node but the root being a child exactly once leaves cycles apart from the root to be
    // excluded.
    std::vector<std::uint32_t> pending{0};
    std::size_t reached = 0;
    Coverage coverage(mesh);
    while (!pending.empty()) {
        const std::uint32_t node = pending.back();
        pending.pop_back();
        ++reached;
        check_finite(bvh.boxes[node], "node " + number(node));
        if (bvh.is_leaf(node)) {
            coverage.see(bvh.reference(node), bvh.boxes[node]);
        } else {
            pending.push_back(bvh.children[node].left);
            pending.push_back(bvh.children[node].right);
        }
    }
    if (reached != bvh.node_count()) broken("some nodes cannot be reached from the root");
    coverage.check_complete();
}

}  // namespace bvhlab
