/// Triangles between points.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/faces.h"

namespace sinew {

using Triangle = std::array<std::uint32_t, 3>;

/// The normal of a triangle, as long as twice its area.
inline Eigen::Vector3d doubled_area(std::span<const Eigen::Vector3d> points, const Triangle& own) {
  return (points[own[1]] - points[own[0]]).cross(points[own[2]] - points[own[0]]);
}

/// Returns the triangles with three different points, of a fan for each face. point_of  of each vertex; empty: each is its
/// own. left_out  of each face; empty: none.
inline std::vector<Triangle> triangles_of(const Faces& faces, std::span<const std::uint32_t> point_of = {},
                                          std::span<const std::uint8_t> left_out = {}) {
  const auto point = [&](std::int32_t v) { return point_of.empty() ? static_cast<std::uint32_t>(v) : point_of[v]; };
  std::vector<Triangle> triangles;
  for (std::size_t face = 0; face < faces.count(); ++face) {
    if (!left_out.empty() && left_out[face]) continue;
    for_triangles(faces.offsets.subspan(face, 2), faces.vertices, [&](const auto& corners) {
      const Triangle own{point(corners[0]), point(corners[1]), point(corners[2])};
      if (own[0] != own[1] && own[1] != own[2] && own[2] != own[0]) triangles.push_back(own);
    });
  }
  return triangles;
}

}  // namespace sinew
