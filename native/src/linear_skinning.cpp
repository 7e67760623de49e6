#include "sinew/linear_skinning.h"

#include "frame_loop.h"
#include "kernels.h"

namespace sinew {

void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  const BlockedSkin& blocked = skin.blocked();
  const std::ptrdiff_t joints = skin.joint_count();
  skin_frames<MatrixRows>(
      skin, matrices, positions, joints + 1,
      [=](MatrixStack<const float> stack, std::ptrdiff_t frame, MatrixRows* palette) {
        using Rows = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
        for (std::ptrdiff_t j = 0; j < joints; ++j) {
          Eigen::Map<Rows>(&palette[j].row[0][0]) = stack.at(frame, j).topRows<3>();
        }
        Eigen::Map<Rows>(&palette[joints].row[0][0]).setIdentity();
      },
      [&](const MatrixRows* palette, std::size_t begin, std::size_t end, float* out) {
        linear_blocks(blocked, begin, end, palette, out);
      });
}

}  // namespace sinew
