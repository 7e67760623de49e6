/// Direct delta mush, a frame and a tile at a time.
#pragma once

#include "mush/packed_mush.h"
#include "skinning/kernels.h"

namespace sinew {

/// palette    J + 1, the last the identity.
/// rotations  likewise, for variants 2 and 4.
void direct_delta_mush_blocks(const DirectDeltaMush::Packed& mush, const Tile& tile, const MatrixRows* palette,
                              const DualQuaternion* rotations);

/// vector, turned by the rotation nearest to `matrix`, 3 x 3, row by row; by none if that is nothing. The slow way,
/// for any matrix.
void turn_by_nearest_rotation(const float* matrix, const float* vector, float* out);

}  // namespace sinew
