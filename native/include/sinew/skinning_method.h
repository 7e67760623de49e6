/// How the joints' motions are blended.
#pragma once

#include <span>

#include "sinew/types.h"

namespace sinew {

enum class SkinningMethod {
  linear,
  dual_quaternion,
  blended,            ///< of the two, see BlendShares
  rotation_centers,   ///< see RotationCenters
  direct_delta_mush,  ///< see DirectDeltaMush
};

constexpr SkinningMethod kSkinningMethods[] = {SkinningMethod::linear, SkinningMethod::dual_quaternion,
                                               SkinningMethod::blended, SkinningMethod::rotation_centers,
                                               SkinningMethod::direct_delta_mush};

/// As Python has it: "dual_quaternion".
const char* name_of(SkinningMethod method);

/// What a method has of its own for each vertex, made before the first frame. Immutable.
class MethodData {
 public:
  virtual ~MethodData() = default;
  /// The one method that takes it, and does not go without.
  virtual SkinningMethod method() const = 0;
  /// V.
  virtual std::ptrdiff_t vertex_count() const = 0;
};

/// How dual quaternion skinning takes joints that scale or shear apart into a stretch and a rigid
/// motion, and when the stretch is applied. Joints that only turn and move are the same in all of
/// these.
enum class Stretch {
  /// Polar decomposition: the symmetric stretch. Stretches are blended linearly and applied first.
  polar,
  /// Along the axes of the joint's rest frame, of which Y keeps its direction, as a bone does.
  /// Blended linearly and applied first. What Blender 3.4 does to preserve volume.
  frame,
  /// Split like `frame`; each joint then moves the point that it has stretched itself. What Blender
  /// 4.3 and 5.2 do.
  frame_each,
};

/// Stretch and, but for `polar`, the rest transform of each joint relative to the space in which
/// the matrices move points: J matrices that only turn and move.
struct StretchRule {
  Stretch stretch = Stretch::polar;
  std::span<const Matrix4<double>> rest_frames{};
};

}  // namespace sinew
