#include "skinned.h"

namespace sinew::rigs {

std::vector<float> mixed_shares(std::ptrdiff_t vertices) {
  std::vector<float> shares;
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    const std::ptrdiff_t stretch = v / 64 % 4;
    shares.push_back(stretch < 2 ? static_cast<float>(v * 7 % 5) / 4 : static_cast<float>(stretch - 2));
  }
  return shares;
}

void skin_mixed(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  skin_blended(skin, BlendShares(mixed_shares(skin.vertex_count())), matrices, positions);
}

RotationCenters random_centers(const Skin& skin) {
  Random random(77);
  std::vector<float> centers;
  std::vector<std::uint8_t> has_center;
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    for (int axis = 0; axis < 3; ++axis) centers.push_back(static_cast<float>(uniform(random, -1, 1)));
    has_center.push_back(v / 64 % 3 != 2 && v % 5 != 4 && skin.offsets()[v] != skin.offsets()[v + 1]);
  }
  return RotationCenters(centers, has_center);
}

void skin_about_centers(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  skin_rotation_centers(skin, random_centers(skin), matrices, positions);
}

std::shared_ptr<const DirectDeltaMush> mush_of(const Skin& skin) {
  const std::shared_ptr<const Skin> borrowed(std::shared_ptr<const Skin>(), &skin);
  return DirectDeltaMush::compute(borrowed, {}, {});
}

void skin_mushed(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  skin_direct_delta_mush(*mush_of(skin), matrices, positions);
}

std::shared_ptr<const MethodData> data_of(SkinningMethod method, const Skin& skin) {
  if (method == SkinningMethod::blended) return std::make_shared<BlendShares>(mixed_shares(skin.vertex_count()));
  if (method == SkinningMethod::rotation_centers) return std::make_shared<RotationCenters>(random_centers(skin));
  if (method == SkinningMethod::direct_delta_mush) return mush_of(skin);
  return nullptr;
}

Eigen::MatrixX3d points_of(const RotationCenters& centers) {
  Eigen::MatrixX3d points(centers.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < centers.vertex_count(); ++v) {
    for (int axis = 0; axis < 3; ++axis) points(v, axis) = centers.centers()[3 * v + axis];
  }
  return points;
}

std::vector<float> skinned(SkinFunction skin_by, const Skin& skin, const Matrices& matrices, std::ptrdiff_t frames,
                           Layout layout) {
  constexpr float kUntouched = -77;
  Stack<float> stack(matrices, frames, layout);
  const std::ptrdiff_t size = 3 * frames * skin.vertex_count();
  std::vector<float> positions(size + 8, kUntouched);
  skin_by(skin, stack.read(), std::span(positions).first(size));
  EXPECT_TRUE(
      std::all_of(positions.begin() + size, positions.end(), [](float number) { return number == kUntouched; }));
  positions.resize(size);
  return positions;
}

}  // namespace sinew::rigs
