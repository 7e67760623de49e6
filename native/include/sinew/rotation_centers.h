/// Optimised centres of rotation, precomputed once for the method `rotation_centers`.
///
/// Le, Hodgins, "Real-time skeletal skinning with optimized centers of rotation", ACM TOG 35(4),
/// 2016.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sinew/progress.h"
#include "sinew/skin.h"
#include "sinew/skinning_method.h"

namespace sinew {

/// The point about which each vertex turns, at rest: the mean of the mesh's surface, weighted by how
/// similar the weights there are to the vertex's own. Immutable.
class RotationCenters final : public MethodData {
 public:
  /// Restores centers that were computed before.
  /// centers     V x 3, in the space of the rest mesh.
  /// has_center  V, not 0 if the vertex has a center. A vertex without one moves linearly, and its
  ///             entry in centers is ignored.
  /// Throws InputError for sizes that do not fit and, naming the vertex, for a center that is not
  /// finite.
  RotationCenters(std::span<const float> centers, std::span<const std::uint8_t> has_center);

  /// Computes p = sum_t s(W_v, W_t) a_t c_t / sum_t s(W_v, W_t) a_t over all triangles t, with a_t the
  /// area, c_t and W_t the means of the corners' positions and weights, and
  /// s(W_a, W_b) = sum_{j != k} w_aj w_ak w_bj w_bk exp(-(w_aj w_bk - w_ak w_bj)^2 / sigma^2).
  /// A vertex has no center if fewer than two joints move it or if no triangle has similar weights.
  ///
  /// skin           V vertices at rest. Weights that are not above 0 count as 0.
  /// face_offsets   faces + 1, where the corners of each face begin; empty: there are no faces.
  /// face_vertices  vertices around each face, face after face; a polygon counts as a fan of triangles.
  /// sigma          above 0; the larger it is, the less similar weights need to be.
  /// progress       or null. If it is cancelled, null is returned within about 0.1 s.
  ///
  /// Triangles whose weights differ by less than a sixteenth of sigma are treated as one, and what
  /// would shift a centre by less than 1e-5 of the mesh's size is left out. The result has the same
  /// bits for any number of threads. The skin must not change meanwhile. Throws InputError for inputs
  /// that do not fit.
  static std::shared_ptr<const RotationCenters> compute(const Skin& skin, std::span<const std::int32_t> face_offsets,
                                                        std::span<const std::int32_t> face_vertices, double sigma = 0.1,
                                                        Progress* progress = nullptr);

  SkinningMethod method() const override { return SkinningMethod::rotation_centers; }
  std::ptrdiff_t vertex_count() const override { return vertex_count_; }

  /// x y z per vertex, in whole blocks of 16; NaN for vertices without a center and after the last
  /// vertex.
  std::span<const float> centers() const { return centers_; }
  bool has_center(std::size_t v) const { return centers_[3 * v] == centers_[3 * v]; }
  /// How many vertices have a center.
  std::ptrdiff_t count() const { return count_; }
  /// Whether any of the vertices 16 b to 16 b + 15 has a center.
  bool block_has_centers(std::size_t b) const { return block_has_centers_[b]; }

 private:
  std::ptrdiff_t vertex_count_;
  std::ptrdiff_t count_ = 0;
  std::vector<float> centers_;
  std::vector<bool> block_has_centers_;
};

}  // namespace sinew
