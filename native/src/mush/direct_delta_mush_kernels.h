/// Direct delta mush, one frame and one tile at a time.
#pragma once

#include "mush/packed_mush.h"
#include "skinning/kernels.h"

namespace sinew {

/// palette    J + 1, the last the identity.
/// rotations  likewise, for variants 2 and 4.
void direct_delta_mush_blocks(const DirectDeltaMush::Packed& mush, const Tile& tile, const MatrixRows* palette,
                              const DualQuaternion* rotations);

/// Turns `vector` by the rotation nearest to `matrix`, 3 x 3, row by row; does not turn it if the matrix is 0. Slow,
/// but works for any matrix.
void turn_by_nearest_rotation(const float* matrix, const float* vector, float* out);

}  // namespace sinew
