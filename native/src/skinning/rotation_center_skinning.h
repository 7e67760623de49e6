/// Skinning about optimised centres of rotation, one tile at a time.
#pragma once

#include "sinew/rotation_centers.h"
#include "skinning/palette.h"

namespace sinew {

/// palette: prepared for linear and dual quaternion skinning. tile.data: RotationCenters.
void run_rotation_centers(const BlockedSkin& skin, const Palette& palette, const Tile& tile);

/// Moves vertex v, at `rest`, with influences of its own.
void rotation_center_vertex(std::size_t v, const Influences& influences, const RotationCenters& centers,
                            const Palette& palette, const float* rest, float* out);

}  // namespace sinew
