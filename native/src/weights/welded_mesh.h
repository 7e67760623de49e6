/// A mesh without its accidents: scale, place, seams and flipped faces.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "sinew/faces.h"
#include "sinew/types.h"

namespace sinew {

using Triangle = std::array<std::uint32_t, 3>;

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
WeldedMesh weld(const UnitFrame& frame, std::span<const double> positions, const Faces& faces);

/// Union and find, where the root of a set is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count);
  std::uint32_t root(std::uint32_t member);
  void join(std::uint32_t a, std::uint32_t b);
  /// Returns the number of each member's set, in the order of their smallest members, and how many there are.
  std::pair<std::vector<std::uint32_t>, std::uint32_t> numbered();

 private:
  std::vector<std::uint32_t> parents_;
};

}  // namespace sinew
