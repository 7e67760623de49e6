/// Converts vertex groups to influences, weighted as in Blender's Armature modifier.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// In the form that Skin takes, in stored order.
struct GroupInfluences {
  std::vector<std::int64_t> offsets;      ///< V + 1
  std::vector<std::int32_t> joints;       ///< N
  std::vector<float> weights;             ///< N
  std::ptrdiff_t unweighted_count = 0;    ///< vertices that no joint moves
  std::ptrdiff_t unnormalized_count = 0;  ///< vertices whose weights, as given, do not sum to 1
};

/// offsets          V + 1: vertex v has the entries offsets[v] up to offsets[v + 1].
/// groups           M, the group of each entry; one outside of 0..G-1 moves nothing.
/// weights          M.
/// joint_of_group   G, the joint of each group, negative if it moves nothing.
/// normalize        the weights of groups that have a joint are divided by their sum; otherwise they stay as they are,
///                  for dual quaternions, whose sums are divided anyway.
/// Zeros are left out, and a vertex whose weights sum to 1e-4 or less stays at rest. Throws InputError for sizes that do
/// not fit.
GroupInfluences group_influences(std::span<const std::int64_t> offsets, std::span<const std::int32_t> groups,
                                 std::span<const float> weights, std::span<const std::int32_t> joint_of_group,
                                 bool normalize = true);

}  // namespace sinew
