/// A mesh without its accidents: seams and flipped faces.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mesh/triangles.h"
#include "sinew/progress.h"
#include "weights/unit_frame.h"

namespace sinew {

struct WeldedMesh {
  std::vector<std::uint32_t> point_of;  ///< V: coincident vertices are one point
  std::vector<Eigen::Vector3d> points;  ///< P, in the unit frame
  std::vector<Triangle> triangles;      ///< with three different points; neighbours are oriented alike
  std::vector<std::uint32_t> patch_of;  ///< of each triangle: those joined by edges of two triangles
  std::vector<std::uint8_t> is_closed;  ///< of each patch: all its edges have two triangles
  std::vector<std::int32_t> part_of;    ///< P: points that triangles connect, directly or through others
  std::int32_t part_count = 0;

  std::size_t patch_count() const { return is_closed.size(); }
  void flip(std::size_t triangle) { std::swap(triangles[triangle][1], triangles[triangle][2]); }
};

/// Everything is already checked.
WeldedMesh weld(const UnitFrame& frame, std::span<const double> positions, const Faces& faces,
                const Progress* progress = nullptr);

}  // namespace sinew
