/// A mesh in motion as the decomposition reads it: centred, scaled, without double vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/progress.h"
#include "sinew/types.h"

namespace sinew {

/// P points, one for all vertices that coincide at rest and move alike, with rest positions about their centroid and those
/// of frames about the centroid of the frame, divided by `size`.
struct Clip {
  std::vector<std::uint32_t> point_of;  ///< V
  std::vector<Eigen::Vector4d> rest;    ///< P: x, y, z, 1
  std::vector<float> moves;             ///< P x F x 3
  std::ptrdiff_t frames = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> frame_centres;  ///< F
  double size = 1;  ///< root of the mean square distance from the centroid, at rest or, if that is 0, in the frames

  Clip() = default;
  /// rest V x 3, frames F x V x 3, finite; V and F are above 0. joins  Whether vertices that coincide become one point.
  Clip(std::span<const float> rest, std::span<const float> frames, bool joins, const Progress* progress);

  std::ptrdiff_t point_count() const { return std::ssize(rest); }
  std::size_t numbers() const { return 3 * static_cast<std::size_t>(frames); }  ///< of a point's moves
  const float* row(std::size_t point) const { return moves.data() + point * numbers(); }

  /// The same with at most so many frames, spread evenly. Vertices are left out.
  Clip with_frames(std::ptrdiff_t most) const;

  /// Skinning matrices between the caller's space and this one.
  Eigen::Matrix<double, 3, 4> inward(const Matrix4<double>& matrix, std::ptrdiff_t frame) const;
  Matrix4<double> outward(const Eigen::Matrix<double, 3, 4>& matrix, std::ptrdiff_t frame) const;
};

}  // namespace sinew
