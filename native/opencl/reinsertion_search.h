// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "build/annealing_choice.h"
#include "build/reinsertion_search.h"
#include "opencl/reinsertion_tree.h"

namespace bvhlab::opencl {

/// Searches for new positions of nodes on a device: the proposals of bvhlab::ReinsertionSearch.
/// Members throw as Commands does.
class ReinsertionSearch {
public:
    explicit ReinsertionSearch(Commands& commands, const ReinsertionTree& tree);

    const Buffer<Reinsertion>& proposals() const { return proposals_; }  ///< by slot of the node

    /// Proposes the best reinsertion of all nodes whose pair leaves `remainder` modulo `sparsity`.
    void climb(std::uint32_t sparsity, std::uint32_t remainder);

    /// The same for the pairs that mark_surroundings() has marked.
    void climb_near();

    /// Proposes by simulated annealing for a random one in `sparsity` nodes.
    void heat(const Heat& heat, std::uint32_t sparsity);

    /// Marks the pairs whose boxes or neighbours the proposals of a climb would change, on the tree
    /// as it is before the moves.
    void mark_surroundings();

private:
    template <class... Chosen>
    void choose(Program& program, const Chosen&... chosen);
    template <class... ChoiceArguments>
    void search(Program& program, const std::string& choice_file,
                const ChoiceArguments&... choice_arguments);
    template <class Launch>
    void in_chunks(std::size_t count, std::size_t& chunk, std::size_t most, Launch&& launch);

    Commands& commands_;
    const ReinsertionTree& tree_;
    Program climbing_, heating_;
    Buffer<Reinsertion> proposals_;
    Buffer<std::uint32_t> searchers_, deep_;  // pairs that search; whose search needs a deep stack
    Buffer<std::uint32_t> counts_;            // of these two
    Buffer<std::uint8_t> marks_;              // by pair
    Buffer<glm::uvec2> stacks_;               // deep ones; none until they are needed
    std::size_t chunk_, deep_chunk_;          // searches to a launch
};

}  // namespace bvhlab::opencl
