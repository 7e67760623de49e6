/// Vertices and what is around them, as the smoothing kernels read it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "sinew/topology.h"
#include "skinning/tile.h"

namespace sinew {

/// So many blocks are one thread's piece of work.
constexpr std::size_t kBlocksPerPiece = 64;

/// The vertices that are worked on, kBlock to a block, one a lane: entry k of a block has neighbour
/// (or corner) k of each of its vertices, so that the lanes take their sums in the order of each
/// vertex's own edges (or faces). A lane that has fewer has itself as a neighbour instead.
///
/// Points are x y z and a fourth float that says nothing: first the vertices that are worked on,
/// ordered within a piece by how many corners and neighbours they have, the last block filled up
/// with its last vertex; then those that are only looked at.
struct Neighbourhood {
  /// Where each entry of a block's vertices begins: kBlock numbers, each 4 times that of a point.
  using Entry = std::uint32_t[kBlock];
  /// The points before and after a corner.
  struct CornerEntry {
    Entry previous;
    Entry next;
  };

  /// weights  V; those that are 0 are not worked on.
  Neighbourhood(const Topology& topology, std::vector<float> weights);

  std::size_t block_count() const { return counts.size() / kBlock; }
  std::size_t point_count() const { return vertices.size(); }

  /// V x 3 numbers to points, of which `begin` up to `end`.
  void take(const float* positions, std::size_t begin, std::size_t end, float* points) const;
  /// Back again, for the vertices of blocks `begin` up to `end`.
  void put(const float* points, std::size_t begin, std::size_t end, float* positions) const;

  std::size_t vertex_count;                    ///< of the mesh
  std::vector<std::uint32_t> vertices;         ///< of each point
  std::size_t worked_on;                       ///< so many of them; without what fills the last block
  std::vector<float> weights;                  ///< one a lane
  std::vector<float> counts;                   ///< neighbours, one a lane
  std::vector<std::uint32_t> neighbour_begin;  ///< blocks + 1, entries
  std::vector<std::uint32_t> corner_begin;
  Aligned<Entry> neighbours;
  Aligned<CornerEntry> corners;
};

/// Memory for one frame's smoothing.
struct SmoothingSpace {
  explicit SmoothingSpace(std::size_t points) : from(aligned<float>(4 * points)), to(aligned<float>(4 * points)) {}
  Aligned<float> from;
  Aligned<float> to;
};

}  // namespace sinew
