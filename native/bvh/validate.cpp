// SPDX-License-Identifier: GPL-3.0-or-later
#include "bvh/validate.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

/// What a walk over a tree has found, to be compared with what the tree says of itself.
struct Found {
    std::size_t references = 0, leaves = 0, largest_leaf = 0, depth = 0;

    void add_leaf(std::size_t size) {
        references += size;
        largest_leaf = std::max(largest_leaf, size);
        ++leaves;
    }

    void check(const Bvh& bvh) const {
        if (references != bvh.reference_count) broken("the stored reference count is wrong");
        if (leaves != bvh.leaf_count) broken("the stored leaf count is wrong");
        if (largest_leaf != bvh.max_leaf_size) broken("the stored largest leaf is wrong");
        if (depth != bvh.max_depth) broken("the stored depth is wrong");
    }
};

/// Whether the nine coordinates that `stored(corner, axis)` gives are the triangle's.
template <class Stored>
void check_corners(const Triangle& triangle, const std::string& where, Stored&& stored) {
    const glm::vec3* corners[3] = {&triangle.a, &triangle.b, &triangle.c};
    for (unsigned corner = 0; corner < 3; ++corner)
        for (unsigned axis = 0; axis < 3; ++axis)
            if (stored(corner, axis) != (*corners[corner])[int(axis)])
                broken("a triangle of " + where + " is not the mesh's");
}

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
        found_.depth = *std::ranges::max_element(depth_);
        found_.check(bvh_);
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
        found_.add_leaf(node.count[i]);
    }

    void check_lane(const TriangleBlock<WideBvh<K>::lanes>& block, unsigned lane, bool used,
                    const Box& box, const std::string& where) {
        const std::uint32_t index = block.triangle[lane];
        if (!used) {
            if (index != no_triangle) broken("an unused lane of " + where + " holds a triangle");
            return;
        }
        coverage_.see(index, box);
        check_corners(bvh_.mesh->triangle(index), where, [&](unsigned corner, unsigned axis) {
            return block.corners[corner][axis][lane];
        });
    }

    const Bvh& bvh_;
    const WideBvh<K>& wide_;
    Coverage coverage_;
    std::vector<std::size_t> depth_;
    std::size_t next_child_ = 1, next_block_ = 0;
    Found found_;
};

/// Breadth-first check of a compressed tree. A decoded box may reach out of the decoded box of its
/// parent by the coarseness of its own grid, so what a ray can reach is the common part of all
/// boxes on the way from the root: a leaf must hold its triangles there.
class CompressedValidator {
public:
    CompressedValidator(const Bvh& bvh, const CompressedBvh& tree)
        : bvh_(bvh), tree_(tree), coverage_(*bvh.mesh), entries_(tree.nodes.size()) {}

    void run() {
        if (tree_.nodes.empty()) broken("there is no root");
        if (tree_.corners.size() !=
            CompressedBvh::corner_floats * tree_.triangles.size() + CompressedBvh::corner_padding)
            broken("the array sizes of the references do not fit");
        constexpr float largest = std::numeric_limits<float>::max();
        entries_[0] = {{glm::vec3(-largest), glm::vec3(largest)}, 1};
        for (std::size_t node = 0; node < tree_.nodes.size(); ++node) check_node(node);
        if (next_child_ != tree_.nodes.size()) broken("some nodes are no node's child");
        if (next_triangle_ != tree_.triangles.size()) broken("some references are in no leaf");
        found_.check(bvh_);
        coverage_.check_complete();
    }

private:
    struct Entry {
        Box reach;  ///< common part of the boxes from the root to the node
        std::size_t depth;
    };

    void check_node(std::size_t index) {
        const CompressedNode& node = tree_.nodes[index];
        const std::string name = "node " + number(index);
        for (int axis = 0; axis < 3; ++axis) {
            if (!std::isfinite(node.origin[axis])) broken(name + " has an origin not finite");
            if (node.exponent[axis] == 0 || node.exponent[axis] == 255)
                broken(name + " has an exponent out of range");
        }
        if (node.first_child != next_child_ || node.first_triangle != next_triangle_)
            broken("what is below " + name + " does not follow what is below the node before it");
        found_.depth = std::max(found_.depth, entries_[index].depth);
        bool any = false;
        for (unsigned slot = 0; slot < 8; ++slot) {
            const bool interior = (node.interior_mask >> slot & 1U) != 0;
            const std::string where = "slot " + number(slot) + " of " + name;
            if (interior != (!node.is_missing(slot) && !node.is_leaf(slot)))
                broken(where + " is interior in one place only");
            if (node.is_missing(slot)) {
                check_missing(node, slot, where);
                continue;
            }
            any = true;
            const Box box = node.box(slot);
            check_finite(box, where);
            const Box reach = intersect(box, entries_[index].reach);
            if (interior)
                check_interior(node, slot, {reach, entries_[index].depth + 1}, where);
            else
                check_leaf(node, slot, reach, where);
        }
        if (!any) broken(name + " has no children");
    }

    static void check_missing(const CompressedNode& node, unsigned slot, const std::string& where) {
        for (int axis = 0; axis < 3; ++axis)
            if (node.planes[axis][slot] != 255 || node.planes[axis + 3][slot] != 0)
                broken(where + " is half missing");
    }

    void check_interior(const CompressedNode& node, unsigned slot, const Entry& entry,
                        const std::string& where) {
        if (node.meta[slot] >> 5 != 1 ||
            (node.meta[slot] & 31U) != CompressedNode::first_interior + slot)
            broken(where + " does not name itself");
        if (node.child_node(slot) != next_child_ || next_child_ >= tree_.nodes.size())
            broken(where + " is not the next node in breadth-first order");
        entries_[next_child_++] = entry;
    }

    void check_leaf(const CompressedNode& node, unsigned slot, const Box& reach,
                    const std::string& where) {
        const std::uint32_t size = node.leaf_size(slot);
        if (size == 0 || node.meta[slot] >> 5 != (1U << size) - 1U)
            broken(where + " has a number of references that is not unary");
        if (node.leaf_triangle(slot) != next_triangle_ ||
            next_triangle_ + size > tree_.triangles.size())
            broken("the references of " + where + " do not follow those of the leaf before it");
        const float* const rows = &tree_.corners[CompressedBvh::corner_floats * next_triangle_];
        for (std::uint32_t i = 0; i < size; ++i) {
            const std::uint32_t triangle = tree_.triangles[next_triangle_ + i];
            coverage_.see(triangle, reach);
            check_corners(bvh_.mesh->triangle(triangle), where,
                          [&](unsigned corner, unsigned axis) {
                              return rows[(3 * corner + axis) * size + i];
                          });
        }
        next_triangle_ += size;
        found_.add_leaf(size);
    }

    const Bvh& bvh_;
    const CompressedBvh& tree_;
    Coverage coverage_;
    std::vector<Entry> entries_;  // by node
    std::size_t next_child_ = 1, next_triangle_ = 0;
    Found found_;
};

template <unsigned K>
void validate_tree(const Bvh& bvh, const WideBvh<K>& wide) {
    WideValidator<K>(bvh, wide).run();
}

void validate_tree(const Bvh& bvh, const CompressedBvh& tree) {
    CompressedValidator(bvh, tree).run();
}

}  // namespace

void validate(const Bvh& bvh) {
    std::visit([&](const auto& tree) { validate_tree(bvh, tree); }, bvh.tree);
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
