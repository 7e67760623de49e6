/// A curve as straight pieces, as Spline IK follows it.
#pragma once

#include <span>
#include <vector>

#include "rig/program.h"

namespace sinew::rig {

/// A place on a path, in the curve object's space.
struct PathPlace {
  Vec3 point;
  float radius = 1;
};

class SplinePath {
 public:
  void reserve(std::size_t pieces);

  /// points: of the spline, each with its handles; radii: one for each of them.
  void build(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii);

  /// Whether there are two different points at least.
  bool is_there() const { return points_.size() > 1; }
  float length() const { return lengths_.back(); }

  /// share: of the length, from the start on. Before 0 and after 1 the first and last piece go on.
  PathPlace at(float share) const;

  /// Where the path leaves a ball around one of its places. Returns the piece that it leaves in.
  ///
  /// from: the piece in which the centre is; share: about where that will be, and then where it is.
  int leave_ball(const Vec3& centre, float size, int from, float& share, PathPlace& place) const;

 private:
  void add_segment(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii,
                   std::size_t i);
  void remove_doubles(int resolution);
  int pieces() const { return static_cast<int>(lengths_.size()); }

  std::vector<Vec3> points_;
  std::vector<float> radii_;
  std::vector<float> lengths_;  // from the start to the end of each piece
};

/// matrix: from the curve object's space at rest to where the hook's target takes it.
void move_by_hook(const SplineHook& hook, const Mat4& matrix, std::span<std::array<Vec3, 3>> points);

/// Places automatic and vector handles again, as Blender does after hooks have moved points; aligned ones stay.
void place_handles(const Spline& spline, std::span<std::array<Vec3, 3>> points);

}  // namespace sinew::rig
