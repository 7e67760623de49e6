#include "mush/direct_delta_mush_skinning.h"

#include "mush/direct_delta_mush_kernels.h"
#include "skinning/dual_quaternion_skinning.h"
#include "skinning/linear_skinning.h"

namespace sinew {

void prepare_direct_delta_mush(const BlockedSkin& skin, const DirectDeltaMush& mush, MatrixStack<const float> matrices,
                               std::ptrdiff_t frame, Palette& palette) {
  prepare_linear(matrices, frame, palette);
  if (mush.packed().blends_quaternions()) prepare_dual_quaternion(skin, {}, matrices, frame, nullptr, palette);
}

void run_direct_delta_mush(const Palette& palette, const Tile& tile) {
  const auto& mush = static_cast<const DirectDeltaMush&>(*tile.data);
  direct_delta_mush_blocks(mush.packed(), tile, palette.matrices.data(), palette.dual_quaternions.data());
}

}  // namespace sinew
