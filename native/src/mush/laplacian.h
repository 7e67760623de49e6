/// The Laplacian of a mesh, for smoothing what its vertices carry.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/direct_delta_mush.h"

namespace sinew {

/// D^-1 L, row by row: L is symmetric with rows that sum to zero, D its positive diagonal. On the diagonal
/// there is 1. A vertex without faces has an empty row, zero on the diagonal too.
struct Laplacian {
  std::vector<std::uint32_t> begin;    ///< V + 1: where the entries of each row begin
  std::vector<std::uint32_t> columns;  ///< ascending in each row, without the diagonal
  std::vector<double> values;          ///< L_ij / D_i
  double largest = 0;                  ///< no eigenvalue is larger; none is negative

  std::size_t vertex_count() const { return begin.size() - 1; }
  bool has_neighbours(std::size_t v) const { return begin[v] != begin[v + 1]; }
};

/// positions, face_offsets, face_vertices  as DirectDeltaMush takes them, checked.
/// Cotangents: of the triangles into which the fan around its first corner cuts a polygon. A triangle without an
/// area counts as an equilateral one.
Laplacian laplacian(std::span<const float> positions, std::span<const std::int32_t> face_offsets,
                    std::span<const std::int32_t> face_vertices, LaplacianKind kind);

}  // namespace sinew
