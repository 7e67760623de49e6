/// The poses of a rig: rotations of every joint, interpolated over time.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// The order in which a file stores the four numbers of a quaternion.
enum class QuaternionOrder { wxyz, xyzw };

/// P poses of J rotations, each on top of the joint's rest transform. Immutable.
class PoseClip {
 public:
  /// rotations  P x J, pose after pose; they are normalised. Throws InputError if there is no pose,
  /// for a number that is not finite and for a quaternion of length 0.
  PoseClip(std::ptrdiff_t joint_count, std::vector<Eigen::Quaterniond> rotations);

  /// Converts the table of a pose.dmat, one column per pose: 4 J rows are quaternions, 3 J rows are
  /// Euler angles in degrees, applied X, then Y, then Z.
  static PoseClip from_table(const Eigen::MatrixXd& table, std::ptrdiff_t joint_count,
                             QuaternionOrder order = QuaternionOrder::wxyz);

  /// Returns the clip as a table of quaternions, 4 J x P, w x y z.
  Eigen::MatrixXd to_table() const;

  std::ptrdiff_t joint_count() const { return joint_count_; }
  std::ptrdiff_t pose_count() const { return pose_count_; }
  const std::vector<Eigen::Quaterniond>& rotations() const { return rotations_; }

  /// Interpolates spherically between the poses on both sides of `time`.
  ///
  /// time       in poses: 0 is the first pose, P - 1 the last.
  /// loop       the first pose follows the last: time wraps at P. Otherwise it is clamped to the ends.
  /// rotations  J, out, unit quaternions.
  /// Throws InputError if time is not finite or the shape does not fit.
  void sample(double time, bool loop, std::span<Eigen::Quaterniond> rotations) const;

 private:
  std::ptrdiff_t joint_count_;
  std::ptrdiff_t pose_count_;
  std::vector<Eigen::Quaterniond> rotations_;
};

/// Computes T(j) of joints that only turn.
///
/// rotations  J unit quaternions.
/// local      1 x J, out.
template <class T>
void rotation_transforms(std::span<const Eigen::Quaterniond> rotations, MatrixStack<T> local);

}  // namespace sinew
