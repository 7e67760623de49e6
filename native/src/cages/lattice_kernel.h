/// Sums over the points of a lattice around a place, compiled for several instruction sets.
#pragma once

#include <cstddef>

namespace sinew {

/// The points of a lattice that have an effect on a vertex, at most four in a row along each axis, and how much of it.
/// Their differences from rest, x y z and the point's own weight, are stored with u changing fastest.
struct LatticeBlock {
  static constexpr std::size_t kMost = 4, kNumbers = 4;

  const float* first;                ///< the numbers of the first point; kMost points can be read from any of the block
  std::size_t row_size, layer_size;  ///< from a point to the next along v and along w, in floats
  std::size_t counts[3];             ///< of points along u, v and w
  alignas(64) float along_u[kMost * kNumbers];  ///< each weight kNumbers times, then zeros
  float along_v[kMost], along_w[kMost];
};

/// sum: kNumbers floats.
void sum_block(const LatticeBlock& block, float* sum);

}  // namespace sinew
