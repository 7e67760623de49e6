/// Laws that hold however joints' motions are blended.
#include <gtest/gtest.h>

#include "failures.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew {
namespace {

using rigs::Layout;
using rigs::Matrices;
using rigs::SkinFunction;
using rigs::skinned;
using rigs::Stack;
using Floats = std::vector<float>;

class EveryMethod : public testing::TestWithParam<std::pair<const char*, SkinFunction>> {
 protected:
  SkinFunction skin_by() const { return GetParam().second; }
};

/// Joints that rest in any place.
template <Stretch stretch>
void skin_in_frames(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  rigs::Random random(12);
  Matrices rest_frames;
  for (std::ptrdiff_t j = 0; j < skin.joint_count(); ++j) rest_frames.push_back(rigs::random_rigid(random));
  skin_dual_quaternion(skin, matrices, positions, {stretch, rest_frames});
}

constexpr std::pair<const char*, SkinFunction> kMethods[] = {{"Linear", skin_linear},
                                                             {"Polar", skin_dual_quaternion},
                                                             {"Frame", skin_in_frames<Stretch::frame>},
                                                             {"FrameEach", skin_in_frames<Stretch::frame_each>},
                                                             {"Blended", rigs::skin_mixed},
                                                             {"RotationCenters", rigs::skin_about_centers},
                                                             {"DirectDeltaMush", rigs::skin_mushed}};

INSTANTIATE_TEST_SUITE_P(Methods, EveryMethod, testing::ValuesIn(kMethods),
                         [](const auto& method) { return std::string(method.param.first); });

TEST_P(EveryMethod, RestPoseIsTheRestMesh) {
  rigs::Random random(1);
  const Skin skin = rigs::random_skin(random, 2000, 20);
  const Floats positions = skinned(skin_by(), skin, rigs::identities(20));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    EXPECT_NEAR(positions[i], skin.rest_positions()[i], 5e-7);
  }
}

TEST_P(EveryMethod, OneRigidTransformMovesEverythingRigidly) {
  rigs::Random random(2);
  const Skin skin = rigs::random_skin(random, 2000, 20);
  const Matrix4<double> motion = rigs::random_rigid(random);
  const Floats positions = skinned(skin_by(), skin, Matrices(20, motion));
  Eigen::MatrixX3d expected(2000, 3);
  for (int v = 0; v < 2000; ++v) {
    const Eigen::Vector3d rest = reference::rest_position(skin, v);
    const bool stays = !reference::is_moved(skin, v);
    expected.row(v) = stays ? rest : Eigen::Vector3d((motion * rest.homogeneous()).head<3>());
  }
  EXPECT_LT(rigs::distance(positions, expected), 2e-6);
}

TEST_P(EveryMethod, WhatNothingMovesStays) {
  const Floats rest{1, 2, 3, 4, 5, 6};
  const Skin skin(rest, std::vector<std::int64_t>{0, 0, 0}, {}, {}, 0);
  EXPECT_EQ(skinned(skin_by(), skin, {}, 1), rest);
}

TEST_P(EveryMethod, FramesAtOnceAreFrameByFrame) {
  rigs::Random random(6);
  // 100 frames of 900 joints are more than the library prepares in one go.
  for (const auto& [frames, joints] : {std::pair{5, 30}, {100, 900}}) {
    const Skin skin = rigs::random_skin(random, 150, joints);
    const Matrices matrices = rigs::random_pose(random, frames * joints);
    const Floats at_once = skinned(skin_by(), skin, matrices, frames);
    for (int frame = 0; frame < frames; ++frame) {
      const auto begin = matrices.begin() + frame * joints;
      const Floats single = skinned(skin_by(), skin, Matrices(begin, begin + joints));
      EXPECT_TRUE(std::equal(single.begin(), single.end(), at_once.begin() + frame * 450)) << frame;
    }
  }
}

TEST_P(EveryMethod, EveryLayoutGivesTheSameBits) {
  rigs::Random random(7);
  const Skin skin = rigs::random_skin(random, 500, 10);
  const Matrices matrices = rigs::random_pose(random, 3 * 10);
  const Floats expected = skinned(skin_by(), skin, matrices, 3);
  for (const Layout layout : rigs::kLayouts) EXPECT_EQ(skinned(skin_by(), skin, matrices, 3, layout), expected);
}

TEST_P(EveryMethod, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  constexpr std::ptrdiff_t kFrames = 10;  // enough work that it is shared out
  rigs::Random random(8);
  const Skin skin = rigs::coherent_skin(random, 30001, 40, 3);
  const Matrices matrices = rigs::random_pose(random, kFrames * 40);
  set_thread_count(1);
  const Floats one = skinned(skin_by(), skin, matrices, kFrames);
  for (const int threads : {2, 3, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(skinned(skin_by(), skin, matrices, kFrames), one) << threads << " threads";
  }
}

TEST_P(EveryMethod, ASmallerSkinAfterALargerOne) {
  rigs::Random random(9);
  const Skin large = rigs::random_skin(random, 100, 50), small = rigs::random_skin(random, 100, 3);
  const Matrices matrices = rigs::random_pose(random, 3);
  const Floats before = skinned(skin_by(), small, matrices);
  skinned(skin_by(), large, rigs::random_pose(random, 50));
  EXPECT_EQ(skinned(skin_by(), small, matrices), before);
}

TEST_P(EveryMethod, NothingIsFine) {
  rigs::Random random(10);
  const Skin no_vertices(Floats{}, std::vector<std::int64_t>{0}, {}, {}, 2);
  EXPECT_EQ(skinned(skin_by(), no_vertices, rigs::identities(2)), Floats{});
  const Skin skin = rigs::random_skin(random, 10, 4);
  Stack<float> no_frames(0, 4);
  Floats positions(30, -77);
  skin_by()(skin, no_frames.read(), std::span(positions).first(0));
  EXPECT_EQ(positions, Floats(30, -77));
  EXPECT_EQ(complaint([&] { skin_by()(skin, no_frames.read(), positions); }),
            "the result holds 30 numbers; expected 0 (0 x 10 x 3)");
}

TEST_P(EveryMethod, RefusesShapesThatDoNotFit) {
  rigs::Random random(11);
  const Skin skin = rigs::random_skin(random, 1000, 4);
  Stack<float> three(1, 3), four(2, 4);
  Floats positions(2 * 3000), too_few(2 * 3000 - 1);
  EXPECT_EQ(complaint([&] { skin_by()(skin, three.read(), positions); }),
            "there are 3 matrices per frame; the skin has 4 joints");
  EXPECT_EQ(complaint([&] { skin_by()(skin, four.read(), too_few); }),
            "the result holds 5,999 numbers; expected 6,000 (2 x 1000 x 3)");
}

}  // namespace
}  // namespace sinew
