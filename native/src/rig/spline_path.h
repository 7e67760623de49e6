/// A curve as straight pieces, as Spline IK and Follow Path follow it.
#pragma once

#include <span>
#include <vector>

#include "rig/program.h"
#include "rig/rotation.h"

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

  /// share: of the length, from the start on. Before 0 and after 1 the first and last piece go on; a closed path begins
  /// again.
  PathPlace at(float share) const { return place_in(piece_at(share)); }

  /// Computes how what follows the path is turned at each of its points, for `rotation_at`.
  void turn(const Spline& spline);

  bool is_turned() const { return !rotations_.empty(); }

  /// How what follows the path is turned, with its Z axis along it. share: as for `at`.
  Quat rotation_at(float share) const;

  /// Where the path leaves a ball around one of its places. Returns the piece that it leaves in.
  ///
  /// from: the piece in which the centre is; share: about where that will be, and then where it is.
  int leave_ball(const Vec3& centre, float size, int from, float& share, PathPlace& place) const;

 private:
  /// A piece and how far along it: 0 to 1 unless it goes on.
  struct Along {
    int piece;
    float share;
  };

  Along piece_at(float share) const;
  PathPlace place_in(const Along& along) const;
  void add_segment(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii,
                   std::size_t i);
  void add_place(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii,
                 const NurbsPlace& place);
  void remove_doubles(int resolution);
  int pieces() const { return static_cast<int>(lengths_.size()); }
  int end_of(int piece) const { return piece + 1 == static_cast<int>(points_.size()) ? 0 : piece + 1; }
  void find_directions();
  void turn_least();

  bool is_closed_ = false;
  std::vector<Vec3> points_;
  std::vector<float> radii_;
  std::vector<float> tilts_;
  std::vector<float> lengths_;    // from the start to the end of each piece
  std::array<Vec3, 2> ends_;      // directions of an open one at its start and its end
  std::vector<Vec3> directions_;  // at each point
  std::vector<Quat> rotations_;   // at each point
};

/// matrix: from the curve object's space at rest to where the hook's target takes it.
void move_by_hook(const SplineHook& hook, const Mat4& matrix, std::span<std::array<Vec3, 3>> points);

/// Places automatic and vector handles again, as Blender does after hooks have moved points; aligned ones stay.
void place_handles(const Spline& spline, std::span<std::array<Vec3, 3>> points);

}  // namespace sinew::rig
