#include "sinew/linear_skinning.h"

#include "frame_loop.h"

namespace sinew {

void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  const float* rest = skin.rest_positions().data();
  const std::int64_t* offsets = skin.offsets().data();
  const std::int32_t* joints = skin.joints().data();
  const float* weights = skin.weights().data();

  // A column of four floats is one register, so a whole matrix is blended in four multiply-adds.
  skin_frames<Matrix4<float>>(
      skin, matrices, positions, [](const auto& matrix) { return Matrix4<float>(matrix); },
      [=](const Matrix4<float>* palette, std::ptrdiff_t v) -> Eigen::Vector3f {
        Matrix4<float> blended = weights[offsets[v]] * palette[joints[offsets[v]]];
        for (std::int64_t i = offsets[v] + 1; i < offsets[v + 1]; ++i) {
          blended += weights[i] * palette[joints[i]];
        }
        const float* p = rest + 3 * v;
        const Eigen::Vector4f moved =
            blended.col(0) * p[0] + blended.col(1) * p[1] + blended.col(2) * p[2] + blended.col(3);
        return moved.head<3>();
      });
}

}  // namespace sinew
