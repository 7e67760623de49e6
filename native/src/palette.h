/// One frame's joints as the kernels read them.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "kernels.h"
#include "sinew/types.h"

namespace sinew {

/// A joint's motion, taken apart: first the stretch, then the rigid motion of `real` and `dual`.
struct RigidAndStretch {
  Eigen::Quaternionf real;
  Eigen::Quaternionf dual;
  Eigen::Matrix<float, 3, 4> stretch;
  bool is_rigid;
};

/// The frame loop keeps it from call to call, so that its memory is not asked for on each frame.
struct Palette {
  // Linear:
  std::vector<MatrixRows> matrices;  ///< J + 1, the last the identity
  // Dual quaternions:
  std::vector<DualQuaternion> dual_quaternions;  ///< J + 1, signs chosen, the last the identity
  std::vector<RigidAndStretch> motions;          ///< J, signs as they came
  std::vector<std::uint8_t> skip;                ///< a joint set: 1 if its vertices go one by one
  bool stretch_each = false;                     ///< Stretch::frame_each
  // Centres of rotation:
  std::optional<Matrix4<double>> from_mesh{};  ///< into the space of the matrices, if that is another one
};

}  // namespace sinew
