/// How strongly the sides of triangles join points.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <span>
#include <vector>

#include "weights/welded_mesh.h"

namespace sinew {

constexpr double kMostCotangent = 20;

/// Calls join(a, b, value) for each side of each triangle: half the cotangent of the angle across from it, clamped to
/// least..20. Returns the areas of points: a third of those of their triangles.
template <class Join>
std::vector<double> join_by_cotangents(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                                       double least, const Join& join) {
  std::vector<double> areas(points.size());
  for (const Triangle& own : triangles) {
    const double area = doubled_area(points, own).norm() / 6;
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t at = own[i], from = own[(i + 1) % 3], to = own[(i + 2) % 3];
      const Eigen::Vector3d a = points[from] - points[at], b = points[to] - points[at];
      const double along = a.dot(b), across = a.cross(b).norm();
      areas[at] += area;
      double cotangent = least;
      if (along >= kMostCotangent * across && along > 0) {
        cotangent = kMostCotangent;
      } else if (along > least * across) {
        cotangent = along / across;
      }
      join(from, to, cotangent / 2);
    }
  }
  return areas;
}

}  // namespace sinew
