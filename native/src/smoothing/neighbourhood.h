/// Vertices and their surroundings, in the form that the smoothing kernels read.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "sinew/topology.h"
#include "skinning/tile.h"

namespace sinew {

/// How many blocks make one piece of work for a thread.
constexpr std::size_t kBlocksPerPiece = 64;

/// The vertices that are smoothed, kBlock per block, one per lane: entry k of a block has neighbour
/// (or corner) k of each of its vertices, so that the lanes sum in the order of each vertex's own edges
/// (or faces). A lane that has fewer has its own vertex as a neighbour instead.
///
/// Points are x y z and an unused fourth float: first the vertices that are smoothed, ordered within a
/// piece by how many corners and neighbours they have, the last block padded with its last vertex; then
/// those that are only read.
struct Neighbourhood {
  /// The places of kBlock points, one per vertex of a block: each is 4 times the point's number.
  using Entry = std::uint32_t[kBlock];
  /// The points before and after a corner.
  struct CornerEntry {
    Entry previous;
    Entry next;
  };

  /// weights  V; vertices of weight 0 are not smoothed.
  Neighbourhood(const Topology& topology, std::vector<float> weights);

  std::size_t block_count() const { return counts.size() / kBlock; }
  std::size_t point_count() const { return vertices.size(); }

  /// Copies V x 3 numbers to points, for the points `begin` up to `end`.
  void gather(const float* positions, std::size_t begin, std::size_t end, float* points) const;
  /// Copies points back, for the vertices of blocks `begin` up to `end`.
  void scatter(const float* points, std::size_t begin, std::size_t end, float* positions) const;

  std::size_t vertex_count;                    ///< of the mesh
  std::vector<std::uint32_t> vertices;         ///< of each point
  std::size_t worked_on;                       ///< how many are smoothed, without the padding
  std::vector<float> weights;                  ///< one per lane
  std::vector<float> counts;                   ///< of neighbours, one per lane
  std::vector<std::uint32_t> neighbour_begin;  ///< blocks + 1, in entries
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
