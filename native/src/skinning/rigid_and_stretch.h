/// A joint's matrix taken apart into a stretch and a rigid motion.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>

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

/// matrix: that of joint j.
RigidAndStretch taken_apart(const Matrix4<float>& matrix, const StretchRule& rule, std::ptrdiff_t j);

/// C M C^-1 of what M was taken apart into: what is rigid is decided where the rest frames are. space: a similarity.
RigidAndStretch carried(const RigidAndStretch& own, const Space& space);

}  // namespace sinew
