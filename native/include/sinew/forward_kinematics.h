/// Computes each joint's world transform from its own transform.
#pragma once

#include "sinew/skeleton.h"
#include "sinew/types.h"

namespace sinew {

/// Computes F(j) = F(parent) R(j) T(j), F(root) = R(root) T(root), for every joint of every frame.
///
/// local   F x J, T(j): pose transform of each joint on top of its rest transform.
/// world   F x J, out, F(j): each joint's transform relative to the world. May be `local` itself,
///         but must not overlap it in any other way.
///
/// Frames, and the skeleton's groups within them, run in parallel if there is enough work; no joint
/// is read by another thread before it is written. The result has the same bits for any number of
/// threads. T is float or double. Throws InputError if a shape does not fit.
template <class T>
void forward_kinematics(const Skeleton& skeleton, MatrixStack<const T> local, MatrixStack<T> world);

/// Computes F(j) A(j)^-1, which moves a vertex from the rest mesh to the pose, for every joint of
/// every frame.
///
/// world      F x J, F(j).
/// matrices   F x J, out, float32 as the skinning functions expect.
template <class T>
void skinning_matrices(const Skeleton& skeleton, MatrixStack<const T> world, MatrixStack<float> matrices);

}  // namespace sinew
