#include "sinew/linear_skinning.h"

#include <gtest/gtest.h>

#include "failures.h"
#include "rigs.h"

namespace sinew {
namespace {

using rigs::Layout;
using rigs::Matrices;
using rigs::Stack;
using Floats = std::vector<float>;

constexpr double kDiagonal = 2 * std::numbers::sqrt3;  // of the box that random_skin fills

Floats skinned(const Skin& skin, const Matrices& matrices, std::ptrdiff_t frames = 1,
               Layout layout = Layout::column_major) {
  Stack<float> stack(matrices, frames, layout);
  Floats positions(3 * frames * skin.vertex_count(), -77.0f);
  skin_linear(skin, stack.read(), positions);
  return positions;
}

TEST(LinearSkinning, HalfWayBetweenTwoJoints) {
  const Skin skin(Floats{1, 2, 3}, std::vector<std::int64_t>{0, 2}, std::vector<std::int32_t>{0, 1},
                  Floats{0.5f, 0.5f}, 2);
  const Matrices matrices{rigs::turn(0, {0, 0, 1}, {10, 0, 0}),
                          (Matrix4<double>() << 0, -1, 0, 0,  //
                           1, 0, 0, 0,                        //
                           0, 0, 1, 8,                        //
                           0, 0, 0, 1)
                              .finished()};
  EXPECT_EQ(skinned(skin, matrices), (Floats{4.5f, 1.5f, 7}));
}

TEST(LinearSkinning, RestPoseIsTheRestMesh) {
  rigs::Random random(1);
  const Skin skin = rigs::random_skin(random, 2000, 20);
  const Floats positions = skinned(skin, rigs::identities(20));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    EXPECT_NEAR(positions[i], skin.rest_positions()[i], 5e-7);
  }
}

TEST(LinearSkinning, OneRigidTransformMovesEverythingRigidly) {
  rigs::Random random(2);
  const Skin skin = rigs::random_skin(random, 2000, 20);
  const Matrix4<double> motion = rigs::random_rigid(random);
  const Floats positions = skinned(skin, Matrices(20, motion));
  Eigen::MatrixX3d expected(2000, 3);
  for (int v = 0; v < 2000; ++v) {
    const Eigen::Vector3d rest = reference::rest_position(skin, v);
    const bool stays = !reference::is_moved(skin, v);
    expected.row(v) = stays ? rest : Eigen::Vector3d((motion * rest.homogeneous()).head<3>());
  }
  EXPECT_LT(rigs::distance(positions, expected), 1e-6);
}

TEST(LinearSkinning, AgreesWithEquation2InDouble) {
  rigs::Random random(3);
  for (const std::int32_t joints : {1, 2, 23, 200}) {
    const Skin skin = rigs::random_skin(random, 3000, joints);
    const Matrices matrices = rigs::through_float(rigs::random_pose(random, joints, 0.5));
    const double error =
        rigs::distance(skinned(skin, matrices), reference::skin_linear(skin, matrices));
    EXPECT_LT(error / kDiagonal, 2e-7) << joints << " joints";
  }
}

TEST(LinearSkinning, AnyAffineMatrixAndAnyWeightCount) {
  rigs::Random random(4);
  const Floats positions{0.5f, -0.25f, 1, 1, 1, 1};
  const Skin skin(positions, std::vector<std::int64_t>{0, 3, 4},
                  std::vector<std::int32_t>{1, 0, 1, 0}, Floats{2, -0.5f, 1, 0.125f},
                  2);  // a joint twice, sums of 2.5 and 0.125
  Matrices matrices = rigs::random_pose(random, 2);
  for (auto& matrix : matrices)
    matrix.topLeftCorner<3, 3>() *= Eigen::Vector3d(-1, 2, 3).asDiagonal();
  matrices = rigs::through_float(matrices);
  EXPECT_LT(rigs::distance(skinned(skin, matrices), reference::skin_linear(skin, matrices)), 2e-6);
}

TEST(LinearSkinning, TheLastRowIsNotRead) {
  rigs::Random random(5);
  const Skin skin = rigs::random_skin(random, 100, 4);
  Matrices matrices = rigs::random_pose(random, 4);
  const Floats expected = skinned(skin, matrices);
  for (auto& matrix : matrices) matrix.row(3) << 5, 6, 7, 8;
  EXPECT_EQ(skinned(skin, matrices), expected);
}

TEST(LinearSkinning, WhatNothingMovesStays) {
  const Floats rest{1, 2, 3, 4, 5, 6};
  const Skin skin(rest, std::vector<std::int64_t>{0, 0, 0}, {}, {}, 0);
  EXPECT_EQ(skinned(skin, {}, 1), rest);
}

TEST(LinearSkinning, FramesAtOnceAreFrameByFrame) {
  rigs::Random random(6);
  // 100 frames of 900 joints are more than the library prepares in one go.
  for (const auto& [frames, joints] : {std::pair{5, 30}, {100, 900}}) {
    const Skin skin = rigs::random_skin(random, 150, joints);
    const Matrices matrices = rigs::random_pose(random, frames * joints);
    const Floats at_once = skinned(skin, matrices, frames);
    for (int frame = 0; frame < frames; ++frame) {
      const auto begin = matrices.begin() + frame * joints;
      const Floats single = skinned(skin, Matrices(begin, begin + joints));
      EXPECT_TRUE(std::equal(single.begin(), single.end(), at_once.begin() + frame * 450)) << frame;
    }
  }
}

TEST(LinearSkinning, EveryLayoutGivesTheSameBits) {
  rigs::Random random(7);
  const Skin skin = rigs::random_skin(random, 500, 10);
  const Matrices matrices = rigs::random_pose(random, 3 * 10);
  const Floats expected = skinned(skin, matrices, 3);
  for (const Layout layout : rigs::kLayouts)
    EXPECT_EQ(skinned(skin, matrices, 3, layout), expected);
}

TEST(LinearSkinning, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  constexpr std::ptrdiff_t kFrames = 10;  // enough work that it is shared out
  rigs::Random random(8);
  const Skin skin = rigs::coherent_skin(random, 30001, 40, 3);
  const Matrices matrices = rigs::random_pose(random, kFrames * 40);
  set_thread_count(1);
  const Floats one = skinned(skin, matrices, kFrames);
  for (const int threads : {2, 3, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(skinned(skin, matrices, kFrames), one) << threads << " threads";
  }
}

TEST(LinearSkinning, ASmallerSkinAfterALargerOne) {
  rigs::Random random(9);
  const Skin large = rigs::random_skin(random, 100, 50), small = rigs::random_skin(random, 100, 3);
  const Matrices matrices = rigs::random_pose(random, 3);
  const Floats before = skinned(small, matrices);
  skinned(large, rigs::random_pose(random, 50));
  EXPECT_EQ(skinned(small, matrices), before);
}

TEST(LinearSkinning, NothingIsFine) {
  rigs::Random random(10);
  const Skin no_vertices(Floats{}, std::vector<std::int64_t>{0}, {}, {}, 2);
  EXPECT_EQ(skinned(no_vertices, rigs::identities(2)), Floats{});
  Stack<float> no_frames(0, 4);
  skin_linear(rigs::random_skin(random, 10, 4), no_frames.read(), {});
}

TEST(LinearSkinning, RefusesShapesThatDoNotFit) {
  rigs::Random random(11);
  const Skin skin = rigs::random_skin(random, 1000, 4);
  Stack<float> three(1, 3), four(2, 4);
  Floats positions(2 * 3000), too_few(2 * 3000 - 1);
  EXPECT_EQ(complaint([&] { skin_linear(skin, three.read(), positions); }),
            "there are 3 matrices a frame; the skin has 4 joints");
  EXPECT_EQ(complaint([&] { skin_linear(skin, four.read(), too_few); }),
            "the result holds 5,999 numbers; expected 6,000 (2 x 1000 x 3)");
}

}  // namespace
}  // namespace sinew
