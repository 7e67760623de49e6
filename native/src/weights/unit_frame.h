/// A space in which every mesh has the same size and place.
#pragma once

#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// Maps the caller's space to one in which the mesh is centred and its longest side is 1.
class UnitFrame {
 public:
  /// positions  V x 3, finite, however large or small.
  explicit UnitFrame(std::span<const double> positions);

  Eigen::Vector3d operator()(const double* point) const;
  /// A length of 1 in the caller's unit; 0 if all positions are equal.
  double size() const { return size_; }

 private:
  int exponent_ = 0;  // positions are divided by 2^exponent first, which is exact, so that nothing overflows
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double scale_ = 1, size_ = 0;
};

/// The positions in a frame.
inline std::vector<Eigen::Vector3d> points_in(const UnitFrame& frame, std::span<const double> positions) {
  std::vector<Eigen::Vector3d> points(positions.size() / 3);
  for (std::size_t v = 0; v < points.size(); ++v) points[v] = frame(positions.data() + 3 * v);
  return points;
}

}  // namespace sinew
