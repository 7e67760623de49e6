#include <gtest/gtest.h>

#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew {
namespace {

using rigs::Matrices;
using Floats = std::vector<float>;

Floats skinned_by_matrices(const Skin& skin, const Matrices& matrices) {
  return rigs::skinned(skin_linear, skin, matrices);
}

TEST(LinearSkinning, HalfWayBetweenTwoJoints) {
  const Skin skin(Floats{1, 2, 3}, std::vector<std::int64_t>{0, 2}, std::vector<std::int32_t>{0, 1}, Floats{0.5f, 0.5f},
                  2);
  const Matrices matrices{rigs::turn(0, {0, 0, 1}, {10, 0, 0}), (Matrix4<double>() << 0, -1, 0, 0,  //
                                                                 1, 0, 0, 0,                        //
                                                                 0, 0, 1, 8,                        //
                                                                 0, 0, 0, 1)
                                                                    .finished()};
  EXPECT_EQ(skinned_by_matrices(skin, matrices), (Floats{4.5f, 1.5f, 7}));
}

TEST(LinearSkinning, AgreesWithEquation2InDouble) {
  rigs::Random random(3);
  for (const std::int32_t joints : {1, 2, 23, 200}) {
    const Skin skin = rigs::random_skin(random, 3000, joints);
    const Matrices matrices = rigs::through_float(rigs::random_pose(random, joints, 0.5));
    const double error = rigs::distance(skinned_by_matrices(skin, matrices), reference::skin_linear(skin, matrices));
    EXPECT_LT(error / rigs::kDiagonal, 2e-7) << joints << " joints";
  }
}

TEST(LinearSkinning, AnyAffineMatrixAndAnyWeightCount) {
  rigs::Random random(4);
  const Floats positions{0.5f, -0.25f, 1, 1, 1, 1};
  const Skin skin(positions, std::vector<std::int64_t>{0, 3, 4}, std::vector<std::int32_t>{1, 0, 1, 0},
                  Floats{2, -0.5f, 1, 0.125f},
                  2);  // a joint twice, sums of 2.5 and 0.125
  Matrices matrices = rigs::random_pose(random, 2);
  for (auto& matrix : matrices) matrix.topLeftCorner<3, 3>() *= Eigen::Vector3d(-1, 2, 3).asDiagonal();
  matrices = rigs::through_float(matrices);
  EXPECT_LT(rigs::distance(skinned_by_matrices(skin, matrices), reference::skin_linear(skin, matrices)), 2e-6);
}

TEST(LinearSkinning, TheLastRowIsNotRead) {
  rigs::Random random(5);
  const Skin skin = rigs::random_skin(random, 100, 4);
  Matrices matrices = rigs::random_pose(random, 4);
  const Floats expected = skinned_by_matrices(skin, matrices);
  for (auto& matrix : matrices) matrix.row(3) << 5, 6, 7, 8;
  EXPECT_EQ(skinned_by_matrices(skin, matrices), expected);
}

}  // namespace
}  // namespace sinew
