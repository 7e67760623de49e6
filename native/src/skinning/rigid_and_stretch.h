/// Splits a joint's matrix into a stretch and a rigid motion.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <span>

#include "sinew/skinning_method.h"
#include "sinew/types.h"
#include "skinning/space.h"

namespace sinew {

/// First the stretch, then the rigid motion of the unit dual quaternion `real` and `dual`.
struct RigidAndStretch {
  Eigen::Quaternionf real = Eigen::Quaternionf::Identity();
  Eigen::Quaternionf dual{0, 0, 0, 0};
  /// How far the stretch moves the point (x y z 1).
  Eigen::Matrix<float, 3, 4> displacement = Eigen::Matrix<float, 3, 4>::Zero();
  bool is_rigid = true;  ///< the stretch moves nothing
};

/// Splits the matrices of some joints in one frame. motions: out, one for each of `joints`.
void split(MatrixStack<const float> matrices, std::ptrdiff_t frame, const StretchRule& rule,
           std::span<const std::int32_t> joints, std::span<RigidAndStretch> motions);

/// Returns C M C^-1 for an M that has been split: whether it is rigid is decided in the space of the rest frames.
/// space: a similarity.
RigidAndStretch carried(const RigidAndStretch& own, const Space& space);

}  // namespace sinew
