#include "linear_skinning.h"

namespace sinew {

void prepare_linear(MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette) {
  using Rows = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
  palette.matrices.resize(matrices.joints + 1);
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    Eigen::Map<Rows>(&palette.matrices[j].row[0][0]) = matrices.at(frame, j).topRows<3>();
  }
  Eigen::Map<Rows>(&palette.matrices.back().row[0][0]).setIdentity();
}

void run_linear(const BlockedSkin& skin, const Palette& palette, const Tile& tile) {
  linear_blocks(skin, tile, palette.matrices.data());
}

}  // namespace sinew
