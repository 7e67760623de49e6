#include "skinning/dual_quaternion_skinning.h"

#include <gtest/gtest.h>

#include "each_instruction_set.h"
#include "sinew/skinning.h"
#include "sinew/threads.h"
#include "skinned.h"

namespace sinew {
namespace {

using rigs::Matrices;
using rigs::Stack;
using Floats = std::vector<float>;
using Offsets = std::vector<std::int64_t>;
using Joints = std::vector<std::int32_t>;

Floats skinned_by_dual_quaternions(const Skin& skin, const Matrices& matrices) {
  return rigs::skinned(skin_dual_quaternion, skin, matrices);
}

void expect_reference(const Skin& skin, const Matrices& matrices, double tolerance) {
  const Matrices rounded = rigs::through_float(matrices);
  EXPECT_LT(rigs::distance(skinned_by_dual_quaternions(skin, rounded), reference::skin_dual_quaternion(skin, rounded)),
            tolerance);
}

/// One vertex at `point` with the given influences.
Skin one_vertex(const Eigen::Vector3f& point, const Joints& joints, const Floats& weights) {
  return Skin({point.data(), 3}, Offsets{0, static_cast<std::int64_t>(joints.size())}, joints, weights,
              static_cast<std::ptrdiff_t>(joints.size()));
}

void expect_point(const Floats& positions, const Eigen::Vector3d& expected, double tolerance = 1e-6) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(positions[axis], expected[axis], tolerance);
}

TEST(DualQuaternionSkinning, HalfWayBetweenTwoTurnsIsTheTurnBetween) {
  const Skin skin = one_vertex({1, 2, 3}, {0, 1}, {0.5f, 0.5f});
  const Eigen::Vector3d z(0, 0, 1);
  expect_point(skinned_by_dual_quaternions(skin, {rigs::identities(1)[0], rigs::turn(90, z, {0, 0, 4})}),
               (rigs::turn(45, z, {0, 0, 2}) * Eigen::Vector4d(1, 2, 3, 1)).head<3>());
}

TEST(DualQuaternionSkinning, AtRestNotABitChanges) {
  rigs::Random random(1);
  const Skin skin = rigs::random_skin(random, 2000, 20);
  EXPECT_TRUE(std::ranges::equal(skinned_by_dual_quaternions(skin, rigs::identities(20)), skin.rest_positions()));
}

TEST(DualQuaternionSkinning, AgreesWithKavanInDouble) {
  rigs::Random random(3);
  for (const std::int32_t joints : {1, 2, 23, 200}) {
    const Skin skin = rigs::random_skin(random, 3000, joints);
    Matrices matrices;  // joints that keep near each other, as on a body: no blend is near zero
    for (int j = 0; j < joints; ++j) {
      matrices.push_back(
          rigs::turn(rigs::uniform(random, -80, 80), rigs::vector(random, 1), rigs::vector(random, 0.5)));
    }
    expect_reference(skin, matrices, 1e-6 * rigs::kDiagonal);
  }
}

TEST(DualQuaternionSkinning, ATwistOf180DegreesKeepsItsVolume) {
  // A ring around the x axis, half moved by a joint that stays, half by one that turns all but half
  // way round: linear blending draws it into the axis.
  Floats ring, weights;
  Offsets offsets{0};
  Joints joints;
  for (int i = 0; i < 16; ++i) {
    const double angle = i * std::numbers::pi / 8;
    ring.insert(ring.end(), {0, static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))});
    joints.insert(joints.end(), {0, 1});
    weights.insert(weights.end(), {0.5f, 0.5f});
    offsets.push_back(2 * (i + 1));
  }
  const Skin skin(ring, offsets, joints, weights, 2);
  const Matrices twist{rigs::identities(1)[0], rigs::turn(179.9, {1, 0, 0})};
  Stack<float> stack(twist, 1);
  Floats linear(ring.size());
  skin_linear(skin, stack.read(), linear);
  const Floats dual = skinned_by_dual_quaternions(skin, twist);
  for (int i = 0; i < 16; ++i) {
    EXPECT_LT(Eigen::Map<const Eigen::Vector3f>(linear.data() + 3 * i).norm(), 0.001f);
    EXPECT_NEAR(Eigen::Map<const Eigen::Vector3f>(dual.data() + 3 * i).norm(), 1, 1e-6);
  }
}

TEST(DualQuaternionSkinning, QAndMinusQAreTheSameRotation) {
  // Half-angles on both sides of 90 degrees: the matrices' quaternions come out with opposite signs
  // along the axis, and adding them as they are would cancel the rotation.
  const Skin skin = one_vertex({1, 0, 0}, {0, 1}, {0.5f, 0.5f});
  const Eigen::Vector3d z(0, 0, 1);
  expect_point(skinned_by_dual_quaternions(skin, {rigs::turn(170, z), rigs::turn(190, z)}), {-1, 0, 0});
  expect_point(skinned_by_dual_quaternions(skin, {rigs::turn(190, z), rigs::turn(170, z)}), {-1, 0, 0});
  expect_point(skinned_by_dual_quaternions(skin, {rigs::turn(-170, z, {0, 0, 1}), rigs::turn(170, z, {0, 0, 3})}),
               {-1, 0, 2});
}

TEST(DualQuaternionSkinning, SignsAreTakenAgainstTheSumSoFarInStoredOrder) {
  // -130 and 120 degrees are nearer each other the other way round, across 180. Whoever comes first
  // decides on which side the third, 0 degrees, is met.
  const Eigen::Vector3d z(0, 0, 1);
  const Matrices turns{rigs::turn(-130, z), rigs::identities(1)[0], rigs::turn(120, z)};
  const Skin outer_first = one_vertex({1, 0, 0}, {0, 2, 1}, {0.25f, 0.25f, 0.5f});
  const Skin in_order = one_vertex({1, 0, 0}, {0, 1, 2}, {0.25f, 0.5f, 0.25f});
  expect_reference(outer_first, turns, 1e-6);
  expect_reference(in_order, turns, 1e-6);
  EXPECT_GT(skinned_by_dual_quaternions(outer_first, turns)[1], 0.9f);  // turned by some 80 degrees
  EXPECT_GT(skinned_by_dual_quaternions(in_order, turns)[0], 0.9f);     // hardly turned
}

TEST(DualQuaternionSkinning, OneJointMayScaleShearAndMirror) {
  rigs::Random random(4);
  const Eigen::Vector3f point(0.5f, -1, 2);
  const Skin skin = one_vertex(point, {0}, {1});
  for (const Eigen::Vector3d& scale : {Eigen::Vector3d(2, 3, 0.5), Eigen::Vector3d(-1, 1, 1),
                                       Eigen::Vector3d(-2, -2, -2), Eigen::Vector3d(1, -3, 0.25)}) {
    Matrix4<double> matrix = rigs::random_rigid(random);
    Eigen::Matrix3d stretch = scale.asDiagonal();
    stretch(0, 1) = 0.3;
    matrix.topLeftCorner<3, 3>() *= stretch;
    expect_point(skinned_by_dual_quaternions(skin, {matrix}), (matrix * point.cast<double>().homogeneous()).head<3>(),
                 4e-6);
  }
}

TEST(DualQuaternionSkinning, StretchesBlendLinearlyAndComeFirst) {
  rigs::Random random(5);
  const Skin skin = rigs::random_skin(random, 2000, 12);
  Matrices matrices;
  for (int j = 0; j < 12; ++j) {
    matrices.push_back(rigs::turn(rigs::uniform(random, -80, 80), rigs::vector(random, 1), rigs::vector(random, 0.5)));
    if (j % 3 == 0) continue;  // some joints are rigid
    const Eigen::Vector3d scale = Eigen::Vector3d(1, 1.5, 2) + rigs::vector(random, 0.2);
    Eigen::Matrix3d stretch = scale.asDiagonal();
    stretch(1, 2) = rigs::uniform(random, -0.2, 0.2);
    if (j == 4) stretch.col(0) *= -1;  // mirrors
    matrices.back().topLeftCorner<3, 3>() *= stretch;
  }
  expect_reference(skin, matrices, 2e-6 * rigs::kDiagonal);
}

TEST(DualQuaternionSkinning, TheSizeOfTheWeightsDoesNotMatter) {
  const Eigen::Vector3d z(0, 0, 1);
  Matrices matrices{rigs::turn(20, z, {1, 0, 0}), rigs::turn(80, z, {0, 1, 0})};
  for (const bool stretched : {false, true}) {
    if (stretched) matrices[1].topLeftCorner<3, 3>() *= 2;
    const Floats whole = skinned_by_dual_quaternions(one_vertex({1, 2, 3}, {0, 1}, {0.25f, 0.75f}), matrices);
    const Floats tenth = skinned_by_dual_quaternions(one_vertex({1, 2, 3}, {0, 1}, {0.025f, 0.075f}), matrices);
    expect_point(tenth, {whole[0], whole[1], whole[2]});
  }
}

TEST(DualQuaternionSkinning, JointsWithoutASizeGiveNumbers) {
  rigs::Random random(6);
  const Skin skin = rigs::coherent_skin(random, 200, 8, 3);
  const Matrices frames = rigs::random_pose(random, 8);
  for (int axes = 1; axes < 8; ++axes) {
    Matrices matrices = rigs::random_pose(random, 8);
    for (int j = 0; j < 8; j += 2) {
      Matrix4<double> scale = Matrix4<double>::Identity();
      for (int axis = 0; axis < 3; ++axis) scale(axis, axis) = axes >> axis & 1 ? 0 : 1;
      matrices[j] = matrices[j] * frames[j] * scale * frames[j].inverse();
    }
    Stack<float> stack(matrices, 1);
    for (const Stretch stretch : {Stretch::polar, Stretch::frame, Stretch::frame_each}) {
      Floats positions(600);
      const Matrices wanted = stretch == Stretch::polar ? Matrices() : frames;
      skin_dual_quaternion(skin, stack.read(), positions, {stretch, wanted});
      for (const float number : positions) EXPECT_LT(std::abs(number), 10) << axes;
    }
  }
  // Frames that are the mesh's own axes: columns that are exactly zero.
  for (int axes = 1; axes < 8; ++axes) {
    Matrix4<double> matrix = Matrix4<double>::Identity();
    for (int axis = 0; axis < 3; ++axis) matrix(axis, axis) = axes >> axis & 1 ? 0 : 1;
    Stack<float> stack(Matrices(8, matrix), 1);
    Floats positions(600);
    const Matrices own_axes = rigs::identities(8);
    skin_dual_quaternion(skin, stack.read(), positions, {Stretch::frame, own_axes});
    for (const float number : positions) EXPECT_LT(std::abs(number), 10) << axes;
  }
}

TEST(DualQuaternionSkinning, ANumberThatIsNoneIsFarFromTheReference) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const auto& point : {Floats{nan, 0, 0}, Floats{0, nan, 0}, Floats{0, 0, nan}}) {
    EXPECT_FALSE(rigs::distance(point, Eigen::MatrixX3d::Zero(1, 3)) < 1);
  }
}

TEST(DualQuaternionSkinning, WhereNoDirectionIsRightTheVertexStays) {
  const Eigen::Vector3d z(0, 0, 1);
  const Matrices matrices{rigs::turn(20, z, {1, 0, 0}), rigs::turn(20, z, {1, 0, 0})};
  EXPECT_EQ(skinned_by_dual_quaternions(one_vertex({1, 2, 3}, {0, 1}, {0.5f, -0.5f}), matrices), (Floats{1, 2, 3}));
  // Weights so small that their squares are no normal numbers any more.
  for (const float weight : {1e-18f, 1e-19f, 1e-20f, 1e-22f, 1e-30f, 1e-45f}) {
    for (const float number : skinned_by_dual_quaternions(one_vertex({1, 2, 3}, {0, 1}, {weight, weight}), matrices)) {
      EXPECT_TRUE(std::isfinite(number)) << weight;
    }
  }
}

/// Joints near each other, so that all signs agree; every `stretched`th stretched along its frame.
Matrices stretching_pose(rigs::Random& random, const Matrices& frames, std::size_t stretched) {
  Matrices pose;
  for (std::size_t j = 0; j < frames.size(); ++j) {
    pose.push_back(rigs::turn(rigs::uniform(random, -60, 60), rigs::vector(random, 1), rigs::vector(random, 0.5)));
    if (j % stretched != 0) continue;
    Matrix4<double> scale = Matrix4<double>::Identity();
    scale.diagonal().head<3>() = Eigen::Vector3d::Ones() + rigs::vector(random, 0.2);
    scale(0, 1) = rigs::uniform(random, -0.1, 0.1);
    pose.back() = pose.back() * frames[j] * scale * frames[j].inverse();
  }
  return rigs::through_float(pose);
}

Eigen::MatrixX3d expected_of(const Skin& skin, const Matrices& pose, const StretchRule& rule) {
  if (rule.stretch == Stretch::polar) return reference::skin_dual_quaternion(skin, pose);
  const Matrices frames(rule.rest_frames.begin(), rule.rest_frames.end());
  return reference::skin_dual_quaternion_in_frames(skin, pose, frames, rule.stretch == Stretch::frame_each);
}

class StretchedJoints : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, StretchedJoints, each_instruction_set(), set_name);

TEST_P(StretchedJoints, EqualTheReference) {
  rigs::Random random(7);
  const Matrices frames = rigs::through_float(rigs::random_pose(random, 20));
  for (const Stretch stretch : {Stretch::polar, Stretch::frame, Stretch::frame_each}) {
    const StretchRule rule{stretch, std::span(frames).first(stretch == Stretch::polar ? 0 : 20)};
    for (const std::size_t each : {1, 2, 5}) {
      const Matrices pose = stretching_pose(random, frames, each);
      Stack<float> stack(pose, 1);
      for (const std::int32_t influences : {1, 3, 8, 14}) {
        for (const std::ptrdiff_t vertices : {1, 17, 2000}) {
          const Skin skin = rigs::coherent_skin(random, vertices, 20, influences);
          Floats positions(3 * vertices);
          skin_dual_quaternion(skin, stack.read(), positions, rule);
          EXPECT_LT(rigs::distance(positions, expected_of(skin, pose, rule)), 2e-6 * rigs::kDiagonal)
              << static_cast<int>(stretch) << ": " << influences << ", " << vertices;
        }
      }
    }
  }
}

TEST_P(StretchedJoints, AnyNumberOfThreadsGivesTheSameBits) {
  rigs::Random random(9);
  const Skin skin = rigs::coherent_skin(random, 1'000'000, 20, 3);
  const Matrices frames = rigs::through_float(rigs::random_pose(random, 20));
  Stack<float> stack(stretching_pose(random, frames, 2), 1);
  for (const Stretch stretch : {Stretch::frame, Stretch::frame_each}) {
    Floats alone(3 * skin.vertex_count()), together(alone.size());
    set_thread_count(1);
    skin_dual_quaternion(skin, stack.read(), alone, {stretch, frames});
    set_thread_count(4);
    skin_dual_quaternion(skin, stack.read(), together, {stretch, frames});
    set_thread_count(0);
    EXPECT_EQ(alone, together);
  }
}

TEST_P(StretchedJoints, AreTheKernelsAndOnlyWhereOneIsStretched) {
  rigs::Random random(8);
  const Skin skin = rigs::coherent_skin(random, 2000, 20, 3);
  const Matrices frames = rigs::through_float(rigs::random_pose(random, 20));
  Matrices pose = stretching_pose(random, frames, 20);  // the first alone
  Stack<float> stack(pose, 1);
  Palette palette;
  for (const Stretch stretch : {Stretch::polar, Stretch::frame, Stretch::frame_each}) {
    prepare_dual_quaternion(skin.blocked(), {stretch, frames}, stack.read(), 0, nullptr, palette);
    for (std::uint32_t set = 0; set < skin.blocked().sets.size(); ++set) {
      const bool has_first = std::ranges::count(skin.blocked().joints_of(set), 0) > 0;
      EXPECT_EQ(palette.ways[set], has_first ? SetWay::stretched : SetWay::rigid) << set;
    }
  }
}

}  // namespace
}  // namespace sinew
