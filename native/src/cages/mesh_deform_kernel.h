/// Sums over the influences of vertices that follow a cage, compiled for several instruction sets.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace sinew {

/// Vertices that are computed together, and the vertices of the cage that any of them follows.
struct CagedBlock {
  static constexpr std::size_t kVertices = 16, kNumbers = 4;

  std::span<const std::uint32_t>
      cage;              ///< where the numbers of each vertex of the cage begin: kNumbers times its number
  const float* weights;  ///< kVertices of each, aligned; 0 for vertices that do not follow it
};

/// moved: kNumbers for each vertex of the cage: x y z, and one that is not read; is_finite: whether all of them are finite.
/// sums: out, aligned, kVertices x, then y, then z, as if a vertex had only the influences that are not 0, in order.
void sum_influences(const CagedBlock& block, const float* moved, bool is_finite, float* sums);

}  // namespace sinew
