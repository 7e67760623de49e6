/// The inner loops of methods with data of their own, compiled for several instruction sets like those
/// of kernels.h.
#pragma once

#include "skinning/kernels.h"

namespace sinew {

/// Blends linear and dual quaternion skinning, each computed as in its own kernel.
/// tile      must have no block whose vertices are blended one by one.
/// matrices  J + 1, the last the identity.
/// shares    of the tile's vertices, in whole blocks.
void blended_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                    const QuaternionJoints& quaternions, const float* shares);

/// v' = R S (v - p) + sum_j w_j M(j) p, R the rotation of the blended real parts, S the blended stretch.
/// centers  p of the tile's vertices, x y z each, in whole blocks; NaN for a vertex without a center,
///          which moves linearly.
void rotation_center_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                            const QuaternionJoints& quaternions, const float* centers);

}  // namespace sinew
