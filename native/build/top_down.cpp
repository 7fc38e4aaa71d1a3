// SPDX-License-Identifier: GPL-3.0-or-later
#include "build/top_down.h"

#include <tbb/concurrent_vector.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "base/parallel.h"
#include "build/chunks.h"
#include "build/clip.h"
#include "build/splitter.h"

namespace bvhlab {
namespace {

constexpr std::uint32_t leaf_bit = 0x80000000U;

/// A finished subtree with its own numbering, depth-first: children's numbers count its interior
/// nodes, or with leaf_bit its leaves. Node 0 is the root; a single leaf has no nodes.
struct Fragment {
    Array<BinaryBvh::Children> nodes;
    Array<Reference> leaves;
};

/// Builds the subtree of a node of at most chunk_size references, in one thread. The references of
/// all nodes that wait lie one after the other on a stack, the next node's at the end.
class FragmentBuilder {
public:
    FragmentBuilder(const Splitter& splitter, const Token& token)
        : splitter_(splitter), token_(token) {}

    Fragment build(ReferenceSet references, const NodeState& root) {
        stack_ = std::move(references);
        waiting_.push_back({root, no_parent, false});
        while (!waiting_.empty()) {
            token_.check();
            const Waiting next = waiting_.back();
            waiting_.pop_back();
            if (next.state.size == 1)
                add_leaf(next);
            else
                split(next);
        }
        return std::move(fragment_);
    }

private:
    static constexpr std::uint32_t no_parent = ~0U;

    struct Waiting {
        NodeState state;
        std::uint32_t parent;
        bool is_right;
    };

    void link(const Waiting& node, std::uint32_t number) {
        if (node.parent == no_parent) return;
        BinaryBvh::Children& children = fragment_.nodes[node.parent];
        (node.is_right ? children.right : children.left) = number;
    }

    void add_leaf(const Waiting& node) {
        link(node, leaf_bit | std::uint32_t(fragment_.leaves.size()));
        fragment_.leaves.push_back(stack_.references.back());
        stack_.resize(stack_.size() - 1);
    }

    void split(const Waiting& node) {
        const auto number = std::uint32_t(fragment_.nodes.size());
        link(node, number);
        fragment_.nodes.emplace_back();

        // Take the node off the stack, put its right and then its left child there.
        const std::size_t begin = stack_.size() - node.state.size;
        const auto take = [&](auto& to, const auto& from) {
            to.assign(from.begin() + std::ptrdiff_t(begin), from.end());
        };
        take(taken_.references, stack_.references);
        for (std::size_t axis = 0; axis < 3; ++axis) take(taken_.orders[axis], stack_.orders[axis]);
        const auto allocate = [&](std::size_t left_size, std::size_t right_size) {
            stack_.resize(begin + right_size + left_size);
            return std::pair(stack_.target(begin + right_size, left_size),
                             stack_.target(begin, right_size));
        };
        const auto [left, right] =
            splitter_.split(taken_.view(0, node.state.size), node.state, scratch_, allocate);
        waiting_.push_back({right, number, true});
        waiting_.push_back({left, number, false});
    }

    const Splitter& splitter_;
    const Token& token_;
    ReferenceSet stack_, taken_;
    std::vector<Waiting> waiting_;
    SplitScratch scratch_;
    Fragment fragment_;
};

/// A node of more than chunk_size references, or the root of a fragment.
struct TopNode {
    NodeState state;
    double weight;            ///< share of the whole work, for the progress
    ReferenceSet references;  ///< until it is split

    std::uint32_t left = 0, right = 0;  ///< children; 0: this is a fragment's root
    Fragment fragment;

    std::size_t leaf_count = 0;  ///< of the subtree
    std::uint32_t first_node = 0, first_leaf = 0;

    bool is_fragment() const { return left == 0; }
};

class TopDownBuilder {
public:
    TopDownBuilder(const Mesh& mesh, const TopDownConfig& config, Token& token)
        : mesh_(mesh), token_(token), splitter_(mesh, config, token) {}

    BinaryBvh build(const TopDownConfig& config) {
        const NodeState root{mesh_.size(), config.duplicate_budget, 0, true};
        nodes_.push_back(TopNode{root, 1.0, sorted_references(mesh_, token_), 0, 0, {}, 0, 0, 0});
        grow_all();
        return number_nodes();
    }

private:
    using Feeder = tbb::feeder<std::uint32_t>;

    /// One task: reads what oneTBB hands over unwatched, as ForkJoin::task does.
    struct Grow {
        TopDownBuilder* builder;
        const ForkJoin* call;

        __attribute__((no_sanitize("thread"))) void operator()(std::uint32_t index,
                                                               Feeder& more) const {
            call->task(
                [self = *this, index, &more] { self.builder->grow(index, more, *self.call); })();
        }
    };

    /// Not a tbb::task_group: before oneTBB 2022 it counts a task before it allocates it, and waits
    /// for ever for one that it could not allocate.
    void grow_all() {
        const ForkJoin call;
        const std::uint32_t root = 0;
        tbb::parallel_for_each(&root, &root + 1, Grow{this, &call});
    }

    /// Grows the subtree of a top node; each right child is a task of its own.
    void grow(std::uint32_t index, Feeder& more, const ForkJoin& call) {
        SplitScratch scratch;
        while (nodes_[index].state.size > chunk_size) {
            split(index, scratch);
            call.fork();
            more.add(nodes_[index].right);
            index = nodes_[index].left;
        }
        TopNode& node = nodes_[index];
        node.fragment =
            FragmentBuilder(splitter_, token_).build(std::move(node.references), node.state);
        node.leaf_count = node.fragment.leaves.size();
        token_.advance(float(done_ += node.weight));
    }

    void split(std::uint32_t index, SplitScratch& scratch) {
        TopNode& node = nodes_[index];
        ReferenceSet left, right;
        const auto allocate = [&](std::size_t left_size, std::size_t right_size) {
            left.resize(left_size);
            right.resize(right_size);
            return std::pair(left.target(0, left_size), right.target(0, right_size));
        };
        const auto [left_state, right_state] = splitter_.split(
            node.references.view(0, node.state.size), node.state, scratch, allocate);
        node.references = {};
        const double left_weight =
            node.weight * double(left_state.size) / double(left_state.size + right_state.size);
        node.left = add(left_state, left_weight, std::move(left));
        node.right = add(right_state, node.weight - left_weight, std::move(right));
    }

    std::uint32_t add(const NodeState& state, double weight, ReferenceSet references) {
        const auto place =
            nodes_.push_back(TopNode{state, weight, std::move(references), 0, 0, {}, 0, 0, 0});
        return std::uint32_t(place - nodes_.begin());
    }

    /// Numbers all nodes depth-first and puts the tree together. Children stand behind their
    /// parents in nodes_.
    BinaryBvh number_nodes() {
        for (std::size_t i = nodes_.size(); i-- > 0;)
            if (!nodes_[i].is_fragment())
                nodes_[i].leaf_count =
                    nodes_[nodes_[i].left].leaf_count + nodes_[nodes_[i].right].leaf_count;
        BinaryBvh bvh = BinaryBvh::with_references(nodes_[0].leaf_count);
        for (TopNode& node : nodes_) {
            if (node.is_fragment()) continue;
            TopNode &left = nodes_[node.left], &right = nodes_[node.right];
            left.first_node = node.first_node + 1;
            left.first_leaf = node.first_leaf;
            right.first_node = node.first_node + std::uint32_t(left.leaf_count);
            right.first_leaf = node.first_leaf + std::uint32_t(left.leaf_count);
            bvh.children[node.first_node] = {root_of(bvh, left), root_of(bvh, right)};
        }
        parallel_for_each(nodes_.size(), 1, token_, [&](std::size_t i) {
            if (nodes_[i].is_fragment()) place(nodes_[i], bvh);
        });
        for (std::size_t i = nodes_.size(); i-- > 0;)
            if (!nodes_[i].is_fragment()) set_box(bvh, nodes_[i].first_node);
        return bvh;
    }

    static std::uint32_t root_of(const BinaryBvh& bvh, const TopNode& node) {
        return node.leaf_count == 1 ? bvh.first_leaf() + node.first_leaf : node.first_node;
    }

    static void set_box(BinaryBvh& bvh, std::uint32_t node) {
        const auto [left, right] = bvh.children[node];
        bvh.boxes[node] = unite(bvh.boxes[left], bvh.boxes[right]);
    }

    /// Copies a fragment to its place, with padded leaf boxes and the interior boxes above them.
    void place(TopNode& top, BinaryBvh& bvh) const {
        const Fragment fragment = std::move(top.fragment);
        for (std::uint32_t i = 0; i < fragment.leaves.size(); ++i) {
            const Reference& leaf = fragment.leaves[i];
            bvh.references[top.first_leaf + i] = leaf.triangle;
            bvh.boxes[bvh.first_leaf() + top.first_leaf + i] =
                padded_box(leaf.box, mesh_.box(leaf.triangle));
        }
        const auto global = [&](std::uint32_t child) {
            return child & leaf_bit ? bvh.first_leaf() + top.first_leaf + (child & ~leaf_bit)
                                    : top.first_node + child;
        };
        for (auto i = std::uint32_t(fragment.nodes.size()); i-- > 0;) {
            bvh.children[top.first_node + i] = {global(fragment.nodes[i].left),
                                                global(fragment.nodes[i].right)};
            set_box(bvh, top.first_node + i);
        }
    }

    const Mesh& mesh_;
    Token& token_;
    Splitter splitter_;
    tbb::concurrent_vector<TopNode> nodes_;
    std::atomic<double> done_{0.0};
};

}  // namespace

BinaryBvh build_top_down(const Mesh& mesh, const TopDownConfig& config, Token& token) {
    token.begin(config.stage);
    return TopDownBuilder(mesh, config, token).build(config);
}

}  // namespace bvhlab
