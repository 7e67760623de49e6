/// B-bones at rest and bent, with values by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "rig_descriptions.h"

namespace sinew {
namespace {

using rig::Mat4;

/// Turns a bone at rest about its length, and about X. Its children stay where they are.
void turn_at_rest(RigDescription& rig, int index, float roll, float bend) {
  BoneDescription& bone = rig.bones[index];
  const rig::Mat3 turn = rig::axis_rotation({1, 0, 0}, bend) * rig::axis_rotation({0, 1, 0}, roll);
  for (int i = 0; i < 9; ++i) bone.rest[4 * (i / 3) + i % 3] = turn[i / 3][i % 3];
  for (int row = 0; row < 3; ++row) bone.tail_in_armature[row] = bone.head_in_armature[row] + turn[1][row];
  for (BoneDescription& each : rig.bones) {
    if (each.parent < 0) continue;
    const auto rest_of = [](const BoneDescription& of) {
      return rig::upper(rig::matrix_of(std::span<const float, 16>(of.rest)));
    };
    const rig::Mat3 in_parent = rig::inverse(rest_of(rig.bones[each.parent])) * rest_of(each);
    for (int i = 0; i < 9; ++i) each.rest_in_parent[i] = in_parent[i / 3][i % 3];
  }
}

/// A B-bone between two bones, which are its handles.
RigDescription bent_between() {
  RigDescription rig;
  add_bone(rig, "before", -1, {0, 0, 0});
  add_bone(rig, "bent", 0, {0, 1, 0});
  add_bone(rig, "after", 1, {0, 2, 0});
  BoneDescription& bent = rig.bones[1];
  bent.segments = 5;
  bent.is_connected = rig.bones[2].is_connected = true;
  bent.connected_child = 2;
  return rig;
}

/// How each end of a segment moves what is at rest.
std::vector<Mat4> motions_of(const RigProgram& program, int bone) {
  std::vector<Matrix4<float>> matrices(program.joint_begin().back());
  const float frame = 1;
  RigOutputs outputs;
  outputs.motions = MatrixStack<float>::of(matrices.data(), 1, std::ssize(matrices));
  program.evaluate({&frame, 1}, {}, outputs);
  std::vector<Mat4> found(program.joint_begin()[bone + 1] - program.joint_begin()[bone]);
  for (std::size_t i = 0; i < found.size(); ++i) {
    std::copy_n(matrices[program.joint_begin()[bone] + i].data(), 16, &found[i].columns[0][0]);
  }
  return found;
}

std::vector<Mat4> segments_of(const RigDescription& rig) {
  const RigProgram program(rig);
  std::vector<Matrix4<float>> matrices(program.segment_begin().back());
  const float frame = 1;
  RigOutputs outputs;
  outputs.segments = MatrixStack<float>::of(matrices.data(), 1, std::ssize(matrices));
  program.evaluate({&frame, 1}, {}, outputs);
  std::vector<Mat4> found(matrices.size());
  for (std::size_t i = 0; i < found.size(); ++i) std::copy_n(matrices[i].data(), 16, &found[i].columns[0][0]);
  return found;
}

TEST(RigBend, AtRestABBoneMovesNothingWhateverItsShape) {
  RigDescription rig = bent_between();
  turn_at_rest(rig, 0, 0.4F, 0);
  turn_at_rest(rig, 2, -0.9F, 0.5F);
  const float shape[kBendValueCount] = {0.2F, -0.1F, 0.3F, 0.15F, 0.6F, -0.8F, 0.7F,
                                        1.3F, 1.2F,  0.6F, 0.9F,  0.8F, 1.7F,  1.1F};
  std::copy_n(shape, +kBendValueCount, rig.bones[1].values.begin() + kRestBend);
  rig.bones[0].values[kRestBend + +kBendRollOut] = 0.5F;
  for (const bool takes_roll : {false, true}) {
    rig.bones[1].uses_end_roll = takes_roll;
    for (const Mat4& motion : motions_of(RigProgram(rig), 1)) {
      for (int column = 0; column < 4; ++column) {
        for (int row = 0; row < 4; ++row) EXPECT_NEAR(motion[column][row], rig::kIdentity4[column][row], 2e-6F);
      }
    }
  }
}

TEST(RigBend, RollsOfTheArmatureAndOfThePoseAddUp) {
  RigDescription rig;
  add_bone(rig, "bent", -1, {0, 0, 0});
  BoneDescription& bent = rig.bones[0];
  bent.segments = 2;
  bent.values[kRestBend + +kBendRollIn] = 0.3F;
  bent.values[kPoseBend + +kBendRollIn] = 0.2F;
  bent.values[kRestBend + +kBendRollOut] = 0.4F;
  bent.values[kPoseBend + +kBendRollOut] = 0.5F;
  const float expected[] = {0.5F, 0.7F, 0.9F};
  const std::vector<Mat4> segments = segments_of(rig);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::atan2(-segments[i][0][2], segments[i][0][0]), expected[i], 1e-6F) << i;
}

TEST(RigBend, BeginsWithTheRollAtTheEndOfTheBoneBefore) {
  RigDescription rig = bent_between();
  rig.bones[0].values[kRestBend + +kBendRollOut] = 0.25F;
  rig.bones[0].values[kPoseBend + +kBendRollOut] = 0.15F;
  for (const bool takes_roll : {false, true}) {
    rig.bones[1].uses_end_roll = takes_roll;
    const Mat4 first = segments_of(rig).front();
    EXPECT_NEAR(std::atan2(-first[0][2], first[0][0]), takes_roll ? 0.4F : 0, 1e-6F);
  }
}

TEST(RigBend, NoEndHasALengthOf0) {
  for (const int end : {0, 1}) {
    const int value = kRestBend + (end == 0 ? kBendScaleIn : +kBendScaleOut) + 1;
    RigDescription rig;
    add_bone(rig, "bent", -1, {0, 0, 0});
    rig.bones[0].segments = 2;
    rig.bones[0].values[value] = 0;
    const std::vector<Mat4> none = segments_of(rig);
    const float first = none[1].location()[1];
    EXPECT_NEAR(end == 0 ? first : 1 - first, 1e-4F, 1e-6F);
    for (const float little : {-1.0F, 0.0001F}) {
      rig.bones[0].values[value] = little;
      EXPECT_EQ(segments_of(rig), none);
    }
  }
}

/// Segments on which no bone depends are computed if they are asked for.
TEST(RigBend, ABoneThatFollowsABendHasIt) {
  RigDescription rig = bent_between();
  const int follower = add_bone(rig, "follower", -1, {3, 0, 0});
  ConstraintDescription& follows = add_constraint(rig, ConstraintType::copy_location, follower, 1);
  set(follows, "head_tail", 0.4F);
  rig.bones[1].values[kPoseBend + +kBendCurveInX] = 0.7F;
  const rig::Vec3 straight = poses_of(rig)[follower].location();
  set(follows, "use_bbone_shape", 1);
  const RigProgram program(rig);
  const rig::Vec3 bent = poses_of(program)[follower].location();
  EXPECT_GT(rig::length(bent - straight), 0.05F);
  std::vector<Matrix4<float>> poses(program.bone_names().size()), segments(program.segment_begin().back());
  const float frame = 1;
  RigOutputs outputs;
  outputs.poses = MatrixStack<float>::of(poses.data(), 1, std::ssize(poses));
  outputs.segments = MatrixStack<float>::of(segments.data(), 1, std::ssize(segments));
  program.evaluate({&frame, 1}, {}, outputs);
  for (int row = 0; row < 3; ++row) EXPECT_EQ(poses[follower](row, 3), bent[row]);
}

}  // namespace
}  // namespace sinew
