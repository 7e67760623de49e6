#include "skinning/linear_skinning.h"

namespace sinew {

void prepare_linear(MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette) {
  using LinearRows = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
  palette.matrices.resize(matrices.joints + 1);
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    Eigen::Map<LinearRows>(&palette.matrices[j].row[0][0]) = matrices.at(frame, j).topRows<3>();
  }
  Eigen::Map<LinearRows>(&palette.matrices.back().row[0][0]).setIdentity();
}

void run_linear(const BlockedSkin& skin, const Palette& palette, const Tile& tile) {
  if (palette.is_spoilt.empty()) return linear_blocks(skin, tile, palette.matrices.data());
  const auto is_spoilt = [&](std::size_t b) { return palette.is_spoilt[skin.blocks[b].joint_set] != 0; };
  for_runs(tile, is_spoilt, [&](bool spoilt, const Tile& part) {
    if (!spoilt) return linear_blocks(skin, part, palette.matrices.data());
    const std::size_t first = part.begin * kBlock;
    for (std::size_t v = first; v < skin.vertex_after(part.end); ++v) {
      const std::size_t at = 3 * (v - first);
      linear_vertex(skin.influences_of(v), part.rest + at, palette.matrices.data(), part.positions + at);
    }
  });
}

}  // namespace sinew
