/// One frame's joints in the form that the kernels read.
#pragma once

#include <optional>
#include <vector>

#include "sinew/types.h"
#include "skinning/kernels.h"
#include "skinning/rigid_and_stretch.h"

namespace sinew {

/// How a joint turns in the space of its matrix. Which way a vertex's joints are blended is decided by these.
struct OwnRotation {
  float real[4];
  float sign;  ///< -1: the joint's DualQuaternion is turned over
};

/// The frame loop keeps it from call to call, so that its memory is not allocated in each frame.
struct Palette {
  /// For each joint set, whether some joint's matrix is not finite. Empty: all are finite. A kernel
  /// multiplies a block by each joint of its set, and 0 times NaN is NaN, so the vertices of such blocks
  /// are blended one at a time, and only those that the joint moves are spoilt.
  std::vector<std::uint8_t> is_spoilt;
  // Linear:
  std::vector<MatrixRows> matrices;  ///< J + 1, the last the identity
  // Dual quaternions, J + 1 of each, the last the identity:
  std::vector<DualQuaternion> dual_quaternions;  ///< signs chosen
  std::vector<OwnRotation> own_rotations;
  std::vector<MatrixRows> displacements;  ///< by the stretches, which are applied first
  std::vector<DualPartRows> dual_parts;   ///< with Stretch::frame_each
  std::vector<std::uint8_t> is_stretched;
  std::vector<SetWay> ways;   ///< one for each joint set
  bool stretch_each = false;  ///< Stretch::frame_each

  // Centres of rotation:
  std::optional<Matrix4<double>> from_mesh{};  ///< to the space of the matrices, if they differ

  QuaternionJoints quaternion_joints() const {
    return {dual_quaternions.data(), displacements.data(), stretch_each ? dual_parts.data() : nullptr, ways.data()};
  }

  /// How far the stretch of joint j moves the point (x y z 1), or the direction (x y z 0).
  Eigen::Vector3f displacement(std::int32_t j, const Eigen::Vector4f& of) const {
    return Eigen::Map<const Eigen::Matrix<float, 3, 4, Eigen::RowMajor>>(displacements[j].row[0]) * of;
  }
};

}  // namespace sinew
