/// The Laplacian of a mesh, for smoothing values at its vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/direct_delta_mush.h"

namespace sinew {

/// D^-1 L, row by row: L is symmetric with rows that sum to zero, D its positive diagonal. The diagonal is 1,
/// but a vertex without faces has an empty row, whose diagonal is 0, too.
struct Laplacian {
  std::vector<std::uint32_t> begin;    ///< V + 1: where the entries of each row begin
  std::vector<std::uint32_t> columns;  ///< ascending in each row, without the diagonal
  std::vector<double> values;          ///< L_ij / D_i
  double largest = 0;                  ///< no eigenvalue is larger; none is negative

  std::size_t vertex_count() const { return begin.size() - 1; }
  bool has_neighbours(std::size_t v) const { return begin[v] != begin[v + 1]; }
};

/// positions, face_offsets, face_vertices  as in DirectDeltaMush, already checked.
/// Cotangents are those of the triangles in the fan around a polygon's first corner. A triangle without area counts as
/// an equilateral one.
Laplacian laplacian(std::span<const float> positions, std::span<const std::int32_t> face_offsets,
                    std::span<const std::int32_t> face_vertices, LaplacianKind kind);

}  // namespace sinew
