/// In what pieces a mesh is worked on.
#pragma once

#include <cstddef>

namespace sinew {

/// Vertices that are computed together. Sixteen fill one AVX-512 register, two of AVX2, four of
/// SSE.
constexpr int kBlock = 16;

/// A block's points: 16 x, 16 y, 16 z.
constexpr std::size_t kBlockFloats = 3 * kBlock;

/// Some consecutive blocks of one frame: where their vertices' positions come from and go. All
/// three begin with the first vertex of block `begin`.
struct Tile {
  std::size_t begin, end;  ///< blocks of the skin
  const float* rest;       ///< x y z a vertex, before skinning
  const float* points;     ///< the same, packed
  float* positions;        ///< out, x y z a vertex
};

/// A tile's blocks, its vertices: points, weights and results fit the second-level cache.
constexpr std::size_t kBlocksPerTile = 256;
constexpr std::size_t kTile = kBlocksPerTile * kBlock;

}  // namespace sinew
