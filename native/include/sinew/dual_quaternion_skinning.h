/// Dual quaternion skinning: no collapse where linear blending loses volume.
#pragma once

#include <span>

#include "sinew/skin.h"
#include "sinew/types.h"

namespace sinew {

/// How joints that scale or shear are taken apart into a stretch and a rigid motion, and when the
/// stretch is applied. Joints that only turn and move are the same in all of these.
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

/// Stretch and, but for `polar`, the rest transform of each joint relative to the space of the
/// mesh: J matrices that only turn and move.
struct StretchRule {
  Stretch stretch = Stretch::polar;
  std::span<const Matrix4<double>> rest_frames{};
};

/// Every vertex moves by the normalised weighted sum of its joints' unit dual quaternions.
///
/// skin        V vertices, J joints.
/// matrices    F x J skinning matrices; their last row is taken to be 0 0 0 1.
/// positions   out, F x V x 3, space of the mesh.
/// rule        what becomes of scale and shear.
///
/// q and -q are the same rotation: each dual quaternion enters the sum with the sign that brings it
/// to the side of the sum so far, influences in their stored order (as Blender does it).
/// Allocates nothing once a thread has seen a skeleton of this size. The same bits for any number
/// of threads. Throws InputError if a shape does not fit.
/// Kavan, Collins, Zara, O'Sullivan, "Geometric skinning with approximate dual quaternion
/// blending", ACM TOG 27(4), 2008: sections 3.3 (blending) and 4.1 (antipodality), 4.2 (scale).
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices,
                          std::span<float> positions, const StretchRule& rule);

/// The same with Stretch::polar.
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices,
                          std::span<float> positions);

}  // namespace sinew
