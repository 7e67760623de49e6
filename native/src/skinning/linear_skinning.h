/// Linear blend skinning, one frame and one tile at a time.
#pragma once

#include "sinew/types.h"
#include "skinning/palette.h"

namespace sinew {

/// matrices: F x J, of which this is frame `frame`.
void prepare_linear(MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette);

void run_linear(const BlockedSkin& skin, const Palette& palette, const Tile& tile);

}  // namespace sinew
