/// Direct delta mush, one frame and one tile at a time.
#pragma once

#include "sinew/direct_delta_mush.h"
#include "sinew/types.h"
#include "skinning/palette.h"
#include "skinning/tile.h"

namespace sinew {

/// matrices: F x J, of which this is frame `frame`.
void prepare_direct_delta_mush(const BlockedSkin& skin, const DirectDeltaMush& mush, MatrixStack<const float> matrices,
                               std::ptrdiff_t frame, Palette& palette);

/// Uses the tile's data.
void run_direct_delta_mush(const Palette& palette, const Tile& tile);

}  // namespace sinew
