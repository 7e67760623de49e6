#include "sinew/linear_skinning.h"

#include "palette.h"

namespace sinew {

void prepare_linear(const BlockedSkin&, const SkinningJob& job, std::ptrdiff_t frame,
                    Palette& palette) {
  const MatrixStack<const float>& matrices = job.matrices;
  using Rows = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
  palette.matrices.resize(matrices.joints + 1);
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    Eigen::Map<Rows>(&palette.matrices[j].row[0][0]) = matrices.at(frame, j).topRows<3>();
  }
  Eigen::Map<Rows>(&palette.matrices.back().row[0][0]).setIdentity();
}

void run_linear(const BlockedSkin& skin, const Palette& palette, std::size_t begin, std::size_t end,
                float* positions) {
  linear_blocks(skin, begin, end, palette.matrices.data(), positions);
}

void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  const SkinningJob job{&skin, matrices, positions, SkinningMethod::linear, {}};
  skin_all({&job, 1});
}

}  // namespace sinew
