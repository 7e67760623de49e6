/// Vertex groups made into influences, as Blender's Armature modifier counts them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// As a Skin takes them, in stored order.
struct GroupInfluences {
  std::vector<std::int64_t> offsets;      ///< V + 1
  std::vector<std::int32_t> joints;       ///< N
  std::vector<float> weights;             ///< N, those of a vertex sum to 1
  std::ptrdiff_t unweighted_count = 0;    ///< vertices that no joint moves
  std::ptrdiff_t unnormalized_count = 0;  ///< vertices whose weights, as given, do not sum to 1
};

/// offsets          V + 1: vertex v has the entries offsets[v] up to offsets[v + 1].
/// groups           M, the group of each entry; one that is not in 0..G-1 moves nothing.
/// weights          M.
/// joint_of_group   G, negative for a group that moves nothing.
/// Weights of groups that move something are divided by their sum. Zeros are left out, and a vertex whose weights sum
/// to 1e-4 or less stays at rest. Throws InputError for sizes that do not fit.
GroupInfluences group_influences(std::span<const std::int64_t> offsets, std::span<const std::int32_t> groups,
                                 std::span<const float> weights, std::span<const std::int32_t> joint_of_group);

}  // namespace sinew
