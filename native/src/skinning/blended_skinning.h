/// Blended linear and dual quaternion skinning, one tile at a time.
#pragma once

#include "sinew/blend_shares.h"
#include "skinning/palette.h"

namespace sinew {

/// palette: prepared for both. tile.data: BlendShares.
void run_blended(const BlockedSkin& skin, const Palette& palette, const Tile& tile);

/// Moves one vertex, at `rest`, with influences of its own.
void blended_vertex(const Influences& influences, const Palette& palette, float share, const float* rest, float* out);

}  // namespace sinew
