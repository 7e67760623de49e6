/// Optimised centres of rotation: precomputed once, for the method `rotation_centers`.
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

/// Where vertices turn about at rest: the mean of the mesh's surface, weighted by how alike its
/// weights are to the vertex's own. Immutable.
class RotationCenters final : public MethodData {
 public:
  /// Those that were computed before.
  /// centers     V x 3, space of the rest mesh.
  /// has_center  V, not 0: the vertex has one. Without it moves linearly, and the center is not looked
  ///             at.
  /// Throws InputError for sizes that do not fit and, naming the vertex, for a center that is not
  /// finite.
  RotationCenters(std::span<const float> centers, std::span<const std::uint8_t> has_center);

  /// p = sum_t s(W_v, W_t) a_t c_t / sum_t s(W_v, W_t) a_t over all triangles t, a_t the area, c_t and
  /// W_t the means of the corners' positions and weights,
  /// s(W_a, W_b) = sum_{j != k} w_aj w_ak w_bj w_bk exp(-(w_aj w_bk - w_ak w_bj)^2 / sigma^2).
  /// A vertex has no center if fewer than two joints move it or if no triangle is like it.
  ///
  /// skin           V vertices at rest. Weights that are not above 0 count as 0.
  /// face_offsets   faces + 1, where the corners of each face begin; empty: there are no faces.
  /// face_vertices  vertices around each face, face after face; a polygon counts as a fan of triangles.
  /// sigma          above 0: the larger, the less alike weights need to be.
  /// progress       or null. If it is cancelled, null is returned within about 0.1 s.
  ///
  /// Triangles that are alike to a sixteenth of sigma are taken together, and what can shift a centre
  /// by less than 1e-5 of the mesh's size is left out. The same bits for any number of threads. The
  /// skin must not change meanwhile. Throws InputError for what does not fit.
  static std::shared_ptr<const RotationCenters> compute(const Skin& skin, std::span<const std::int32_t> face_offsets,
                                                        std::span<const std::int32_t> face_vertices, double sigma = 0.1,
                                                        Progress* progress = nullptr);

  SkinningMethod method() const override { return SkinningMethod::rotation_centers; }
  std::ptrdiff_t vertex_count() const override { return vertex_count_; }

  /// x y z a vertex, in whole blocks of 16; not a number where there is none, and behind the last
  /// vertex.
  std::span<const float> centers() const { return centers_; }
  bool has_center(std::size_t v) const { return centers_[3 * v] == centers_[3 * v]; }
  /// How many vertices have one.
  std::ptrdiff_t count() const { return count_; }
  /// Whether some vertex of 16 b up to 16 b + 15 has one.
  bool block_has_centers(std::size_t b) const { return block_has_centers_[b]; }

 private:
  std::ptrdiff_t vertex_count_;
  std::ptrdiff_t count_ = 0;
  std::vector<float> centers_;
  std::vector<bool> block_has_centers_;
};

}  // namespace sinew
