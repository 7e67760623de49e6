/// The pieces in which a mesh is processed.
#pragma once

#include <cstddef>

namespace sinew {

class MethodData;

/// How many vertices are computed together. Sixteen fill one AVX-512 register, two AVX2 registers or
/// four SSE registers.
constexpr int kBlock = 16;

/// A block's points: 16 x, 16 y, 16 z.
constexpr std::size_t kBlockFloats = 3 * kBlock;

/// Consecutive blocks of one frame, with the input and output positions of their vertices. All three
/// arrays begin with the first vertex of block `begin`.
struct Tile {
  std::size_t begin, end;  ///< blocks of the skin
  const float* rest;       ///< x y z per vertex, before skinning
  const float* points;     ///< the same, packed
  float* positions;        ///< out, x y z per vertex
  const MethodData* data;  ///< the whole mesh's, or null

  /// Returns a tile of some of its blocks.
  Tile part(std::size_t first, std::size_t last) const;
};

inline Tile Tile::part(std::size_t first, std::size_t last) const {
  const std::size_t at = (first - begin) * kBlockFloats;
  return {first, last, rest + at, points + at, positions + at, data};
}

/// Calls run(way, part) for the longest runs of blocks b of a tile that have the same way_of(b).
template <class WayOf, class Run>
void for_runs(const Tile& tile, const WayOf& way_of, const Run& run) {
  for (std::size_t b = tile.begin, end; b < tile.end; b = end) {
    const auto way = way_of(b);
    for (end = b + 1; end < tile.end && way_of(end) == way;) ++end;
    run(way, tile.part(b, end));
  }
}

/// How many blocks and vertices a tile has: points, weights and results fit in the second-level cache.
constexpr std::size_t kBlocksPerTile = 256;
constexpr std::size_t kTile = kBlocksPerTile * kBlock;

}  // namespace sinew
