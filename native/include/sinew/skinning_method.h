/// How the joints' motions are blended.
#pragma once

#include <optional>
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

/// Returns the method's name in Python, such as "dual_quaternion".
const char* name_of(SkinningMethod method);

/// A method's own data for each vertex, made before the first frame. Immutable.
class MethodData {
 public:
  virtual ~MethodData() = default;
  /// The one method that uses this data, and cannot do without it.
  virtual SkinningMethod method() const = 0;
  /// V.
  virtual std::ptrdiff_t vertex_count() const = 0;
  /// J, of data that was made for certain joints.
  virtual std::optional<std::ptrdiff_t> joint_count() const { return std::nullopt; }
};

/// How dual quaternion skinning splits the motion of joints that scale or shear into a stretch and a
/// rigid motion, and when the stretch is applied. For joints that only turn and move, all are the
/// same.
enum class Stretch {
  /// Polar decomposition: the symmetric stretch. Stretches are blended linearly and applied first.
  polar,
  /// Along the axes of the joint's rest frame, whose Y axis keeps its direction, as a bone does.
  /// Blended linearly and applied first. What Blender 3.4 does to preserve volume.
  frame,
  /// Split as in `frame`; each joint then moves the point that it has stretched itself. What Blender
  /// 4.3 and 5.2 do.
  frame_each,
};

/// The Stretch and, except for `polar`, the rest transform of each joint relative to the space in
/// which the matrices move points: J matrices that only turn and move.
struct StretchRule {
  Stretch stretch = Stretch::polar;
  std::span<const Matrix4<double>> rest_frames{};
  /// Throw HalfTurn if dual quaternions of joints that move the same vertices, or some beside them, are half a turn
  /// apart, but for rounding.
  bool refuses_half_turns = false;
};

}  // namespace sinew
