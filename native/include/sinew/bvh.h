/// Motion in a .bvh file (Biovision hierarchy): joints without a rest rotation, and their poses on frames.
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "sinew/skeleton.h"

namespace sinew {

/// F frames of J joints: T(j) = location, then rotation. Immutable.
class BvhClip {
 public:
  /// parents     J, the parent of each joint or -1 for a root.
  /// offsets     J x 3, at rest: where each joint is relative to its parent; a root's: to the world.
  /// ends        J x 3, at rest: where the bone of a joint without children ends, relative to the joint.
  /// names       J.
  /// frame_time  seconds from one frame to the next.
  /// locations   F x J x 3, frame after frame, relative to the place at rest.
  /// rotations   F x J; they are normalised.
  /// Throws InputError for sizes that do not fit, a parent that does not exist, a cycle, no frame, a number that is not
  /// finite, a quaternion of length 0, a frame time that is not positive.
  BvhClip(std::span<const std::int32_t> parents, std::vector<Eigen::Vector3d> offsets,
          std::vector<Eigen::Vector3d> ends, std::vector<std::string> names, double frame_time,
          std::vector<Eigen::Vector3d> locations, std::vector<Eigen::Quaterniond> rotations);

  /// Whose rest transforms are translations.
  const Skeleton& skeleton() const { return skeleton_; }
  std::ptrdiff_t frame_count() const { return frame_count_; }
  const std::vector<Eigen::Vector3d>& offsets() const { return offsets_; }
  const std::vector<Eigen::Vector3d>& ends() const { return ends_; }
  const std::vector<std::string>& names() const { return names_; }
  double frame_time() const { return frame_time_; }
  const std::vector<Eigen::Vector3d>& locations() const { return locations_; }
  const std::vector<Eigen::Quaterniond>& rotations() const { return rotations_; }

 private:
  Skeleton skeleton_;
  std::vector<Eigen::Vector3d> offsets_;
  std::vector<Eigen::Vector3d> ends_;
  std::vector<std::string> names_;
  double frame_time_;
  std::vector<Eigen::Vector3d> locations_;
  std::vector<Eigen::Quaterniond> rotations_;
  std::ptrdiff_t frame_count_ = 0;
};

/// Reads a .bvh file. Joints are in the file's order, parents first. A joint may have any of the six channels, in any
/// order; a position is relative to the parent and stands in place of the offset. Axes and units are the file's.
/// Throws InputError with file and line for what is not as the format says, and if the file describes more poses of
/// joints than it has bytes.
BvhClip read_bvh(const std::filesystem::path& path);

/// Writes a .bvh file that reads back as the same motion, to rounding: joints depth first, rotations about Z, Y and X,
/// and positions of roots and of joints that move. Angles go on from frame to frame. Throws InputError for a name that
/// the format cannot hold, and if the file cannot be written.
void write_bvh(const std::filesystem::path& path, const BvhClip& clip);

}  // namespace sinew
