/// Dual quaternion skinning: no collapse where linear blending loses volume.
#pragma once

#include <span>

#include "sinew/skin.h"
#include "sinew/types.h"

namespace sinew {

/// Every vertex moves by the normalised weighted sum of its joints' unit dual quaternions.
///
/// skin        V vertices, J joints.
/// matrices    F x J skinning matrices; their last row is taken to be 0 0 0 1.
/// positions   out, F x V x 3, space of the mesh.
///
/// q and -q are the same rotation: each dual quaternion enters the sum with the sign that brings it
/// to the side of the sum so far, influences in their stored order (as Blender does it).
/// A matrix that scales or shears is split into rotation and stretch (polar decomposition); the
/// stretches are blended linearly and applied first.
/// Allocates nothing once a thread has seen a skeleton of this size. The same bits for any number
/// of threads. Throws InputError if a shape does not fit.
/// Kavan, Collins, Zara, O'Sullivan, "Geometric skinning with approximate dual quaternion
/// blending", ACM TOG 27(4), 2008: sections 3.3 (blending) and 4.1 (antipodality), 4.2 (scale).
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices,
                          std::span<float> positions);

}  // namespace sinew
