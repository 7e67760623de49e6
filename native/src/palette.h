/// The two skinning methods as the frame loop sees them: what is prepared once a frame, and what
/// runs over blocks.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "blocked_skin.h"
#include "kernels.h"
#include "sinew/skinning.h"

namespace sinew {

/// A joint's motion, taken apart: first the stretch, then the rigid motion of `real` and `dual`.
struct RigidAndStretch {
  Eigen::Quaternionf real;
  Eigen::Quaternionf dual;
  Eigen::Matrix<float, 3, 4> stretch;
  bool is_rigid;
};

/// One frame's joints as the kernels read them. The loop keeps it from call to call, so that its
/// memory is not asked for on each frame.
struct Palette {
  // Linear:
  std::vector<MatrixRows> matrices;  ///< J + 1, the last the identity
  // Dual quaternions:
  std::vector<DualQuaternion> dual_quaternions;  ///< J + 1, signs chosen, the last the identity
  std::vector<RigidAndStretch> motions;          ///< J, signs as they came
  std::vector<std::uint8_t> skip;                ///< a joint set: 1 if its vertices go one by one
  bool stretch_each = false;                     ///< Stretch::frame_each
};

void prepare_linear(const BlockedSkin& skin, const SkinningJob& job, std::ptrdiff_t frame,
                    Palette& palette);
void prepare_dual_quaternion(const BlockedSkin& skin, const SkinningJob& job, std::ptrdiff_t frame,
                             Palette& palette);

/// Every vertex of blocks begin..end. positions: V x 3, out, the whole frame's.
void run_linear(const BlockedSkin& skin, const Palette& palette, std::size_t begin, std::size_t end,
                float* positions);
void run_dual_quaternion(const BlockedSkin& skin, const Palette& palette, std::size_t begin,
                         std::size_t end, float* positions);

}  // namespace sinew
