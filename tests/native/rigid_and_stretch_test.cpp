#include "skinning/rigid_and_stretch.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <vector>

#include "each_instruction_set.h"
#include "rig/dual_quaternion.h"

namespace sinew {
namespace {

class RigidAndStretches : public OnEachInstructionSet {};

constexpr int kJointCount = 400;

Matrix4<float> turned(std::mt19937& random, float angle, float distance) {
  std::uniform_real_distribution<float> some(-1, 1);
  const auto vector = [&] { return Eigen::Vector3f(some(random), some(random), some(random)); };
  Matrix4<float> m = Matrix4<float>::Identity();
  m.topLeftCorner<3, 3>() = Eigen::AngleAxisf(angle * some(random), vector().normalized()).matrix();
  m.topRightCorner<3, 1>() = distance * vector();
  return m;
}

rig::Mat4 columns_of(const Matrix4<float>& m) {
  rig::Mat4 result;
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) result[i][k] = m(k, i);
  }
  return result;
}

// Joints that mirror lie half a turn apart from others. Which way is then taken between them is a matter of the last
// bit, so it has to be Blender's, which the rig's dual quaternions have.
TEST_P(RigidAndStretches, MirroredJointsHaveTheRotationsOfBlender) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> one_of_three(-1, 1);
  std::vector<Matrix4<float>> matrices;
  std::vector<Matrix4<double>> rest_frames;
  std::vector<rig::DualQuaternion> expected;
  for (int j = 0; j < kJointCount; ++j) {
    const Matrix4<float> rest = turned(random, 3, 4);
    Matrix4<float> local = turned(random, j % 2 ? 0.f : 3.f, 1);
    for (int i = 0; i < 3; ++i) local.col(i) *= one_of_three(random) + (j % 3 ? 0.5f : 0.f);
    matrices.push_back(rest * local * rest.inverse());
    rest_frames.push_back(rest.cast<double>());
    expected.push_back(rig::dual_quaternion_of(columns_of(rest), columns_of(matrices[j])));
  }
  std::vector<std::int32_t> joints(kJointCount);
  std::iota(joints.begin(), joints.end(), 0);
  std::vector<RigidAndStretch> motions(kJointCount);
  split(MatrixStack<const float>::of(matrices.data(), 1, kJointCount), 0,
        {.stretch = Stretch::frame_each, .rest_frames = rest_frames}, joints, motions);
  for (int j = 0; j < kJointCount; ++j) {
    const Eigen::Quaternionf& q = motions[j].real;
    const Eigen::Vector4f parts(q.w(), q.x(), q.y(), q.z());
    for (int i = 0; i < 4; ++i) ASSERT_EQ(parts[i], expected[j].rotation[i]) << "joint " << j << ", number " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, RigidAndStretches, each_instruction_set(), set_name);

}  // namespace
}  // namespace sinew
