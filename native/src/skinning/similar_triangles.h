/// Finds the triangles of a mesh whose weights are similar to a vertex's.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "sinew/progress.h"
#include "sinew/skin.h"
#include "sinew/weight_table.h"

namespace sinew {

/// Returns the influences of each vertex: each joint once, ascending, with a weight above 0.
WeightTable merged_influences(const Skin& skin);

/// For each pair of joints, the triangles that both move; those with nearly the same weights are
/// combined in one cell. With X, Y the weights of the two joints, a cell has the mass m = sum a X Y,
/// the mean weights and the moment sum a X Y c, where areas are fractions of the mesh's area and
/// positions are relative to `origin`.
class SimilarTriangles {
 public:
  /// faces as in RotationCenters::compute, already checked. Advances progress by one step per triangle;
  /// if that is cancelled it stops, and the object must not be used.
  SimilarTriangles(const Skin& skin, const WeightTable& influences, std::span<const std::int32_t> face_offsets,
                   std::span<const std::int32_t> face_vertices, double sigma, Progress& progress);

  /// Returns the center of a vertex with these influences: x y z, or NaN.
  std::array<float, 3> center_of(std::span<const BoneWeight> own) const;

 private:
  /// Six rows of numbers in cells_, padded with cells without mass: x / sigma, y / sigma, m, and the
  /// moment.
  struct Pair {
    std::size_t begin;   ///< in cells_
    std::size_t length;  ///< of a row
    double mass;
  };

  std::unordered_map<std::uint64_t, std::uint32_t> pair_of_joints_;
  std::vector<Pair> pairs_;
  std::vector<float> cells_;
  std::array<double, 3> origin_{};
  double sigma_;
};

}  // namespace sinew
