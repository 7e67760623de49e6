/// Splits poses into what is keyed: location, rotation and scale of each joint relative to its parent.
#pragma once

#include <span>
#include <vector>

#include "sinew/skeleton.h"
#include "sinew/types.h"

namespace sinew {

/// F frames of J joints, frame after frame: T(j) = location, rotation, scale along the joint's own axes.
struct LocalTransforms {
  std::vector<double> locations;        ///< F x J x 3
  std::vector<double> rotations;        ///< F x J x 4, unit quaternions w x y z, each on the short way from the last
  std::vector<double> scales;           ///< F x J x 3, all below 0 if the joint mirrors
  std::vector<Matrix4<double>> played;  ///< F x J, F(j) as forward_kinematics makes it of these
};

/// Computes the transforms from which forward_kinematics makes these poses.
///
/// world      F x J, F(j): each joint's transform relative to the world. T is float or double.
/// may_move   J, whether a joint may have a location; empty: all may.
///
/// A joint that shears relative to its parent gets the nearest rotation, and the scale along its own axes that is
/// nearest then; `played` tells what that makes of it. Its children are relative to what is played. Frames run in
/// parallel, and the result has the same bits for any number of threads. Throws InputError if a shape does not fit, for
/// a number that is not finite, and if a joint that has children has a scale of 0 along an axis.
template <class T>
LocalTransforms local_transforms(const Skeleton& skeleton, MatrixStack<const T> world,
                                 std::span<const std::uint8_t> may_move = {});

}  // namespace sinew
