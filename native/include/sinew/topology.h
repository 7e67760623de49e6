/// The connectivity of a mesh.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/faces.h"
#include "sinew/lists.h"
#include "sinew/types.h"

namespace sinew {

/// Which vertices are joined by edges, and the neighbours of each vertex in its faces. Immutable.
class Topology {
 public:
  /// A face's corner at a vertex: the vertices before and after it around the face.
  struct Corner {
    std::uint32_t previous;
    std::uint32_t next;
  };

  /// vertex_count     V.
  /// edges            E x 2, vertices. Sums over neighbours are taken in this order, as in Blender.
  ///                  Edges without a face are allowed.
  /// face_offsets     faces + 1, where the corners of each face begin; empty: there are no faces.
  /// corner_vertices  C, vertices around each face, face after face.
  /// Throws InputError for a vertex out of range, for offsets that do not fit, for a face with
  /// fewer than three corners and for one with a side that is not an edge.
  Topology(std::ptrdiff_t vertex_count, std::span<const std::int32_t> edges,
           std::span<const std::int32_t> face_offsets = {}, std::span<const std::int32_t> corner_vertices = {});

  /// V.
  std::ptrdiff_t vertex_count() const { return static_cast<std::ptrdiff_t>(neighbours_.size()); }
  /// E.
  std::ptrdiff_t edge_count() const { return std::ssize(neighbours_.items) / 2; }
  /// C.
  std::ptrdiff_t corner_count() const { return std::ssize(corners_.items); }

  /// The other ends of a vertex's edges, in the order of the edges.
  std::span<const std::uint32_t> neighbours(std::size_t v) const { return neighbours_[v]; }
  /// A vertex's corners, in the order of the faces.
  std::span<const Corner> corners(std::size_t v) const { return corners_[v]; }
  /// Whether the vertex is on an edge that belongs to exactly one face.
  bool is_boundary(std::size_t v) const { return is_boundary_[v]; }

 private:
  void find_boundary(std::span<const std::int32_t> edges, const Faces& faces);

  Lists<std::uint32_t> neighbours_;
  Lists<Corner> corners_;
  std::vector<bool> is_boundary_;
};

}  // namespace sinew
