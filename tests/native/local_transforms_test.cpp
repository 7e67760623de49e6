#include "sinew/local_transforms.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "rigs.h"
#include "sinew/forward_kinematics.h"
#include "sinew/threads.h"

namespace sinew {
namespace {

using rigs::Matrices;
using rigs::Stack;

constexpr std::ptrdiff_t kFrames = 9;

Matrices posed(const Skeleton& skeleton, const Matrices& local) {
  Stack<double> source(local, kFrames), world(kFrames, skeleton.joint_count(), rigs::Layout::column_major);
  forward_kinematics(skeleton, source.read(), world.view());
  return world.matrices();
}

/// Random rotations and places, each axis of which is scaled by a number of `sizes`.
Matrices random_locals(rigs::Random& random, std::ptrdiff_t joints, double smallest, double largest) {
  Matrices locals;
  for (std::ptrdiff_t i = 0; i < kFrames * joints; ++i) {
    const Matrices turn = rigs::random_pose(random, 1);
    Eigen::Vector4d sizes(1, 1, 1, 1);
    for (int axis = 0; axis < 3; ++axis) sizes[axis] = rigs::uniform(random, smallest, largest);
    locals.push_back(turn[0] * sizes.asDiagonal());
  }
  return locals;
}

LocalTransforms split(const Skeleton& skeleton, const Matrices& world, std::span<const std::uint8_t> may_move = {}) {
  Stack<double> stack(world, kFrames);
  return local_transforms(skeleton, stack.read(), may_move);
}

double distance(const Matrices& a, const Matrices& b) {
  double found = 0;
  for (std::size_t i = 0; i < a.size(); ++i) found = std::max(found, (a[i] - b[i]).cwiseAbs().maxCoeff());
  return found;
}

TEST(LocalTransforms, AreWhatForwardKinematicsWasGiven) {
  rigs::Random random(1);
  const Skeleton skeleton(rigs::random_forest(random, 20), rigs::random_pose(random, 20));
  const Matrices locals = random_locals(random, 20, 0.8, 1.25), world = posed(skeleton, locals);
  const LocalTransforms found = split(skeleton, world);
  Matrices again;
  for (std::size_t i = 0; i < locals.size(); ++i) {
    const double* q = &found.rotations[4 * i];
    Matrix4<double> local = Matrix4<double>::Identity();
    local.topLeftCorner<3, 3>() = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix() *
                                  Eigen::Map<const Eigen::Vector3d>(&found.scales[3 * i]).asDiagonal();
    local.topRightCorner<3, 1>() = Eigen::Map<const Eigen::Vector3d>(&found.locations[3 * i]);
    again.push_back(local);
  }
  EXPECT_LT(distance(again, locals), 1e-11);
  EXPECT_LT(distance(found.played, world), 1e-11);
}

TEST(LocalTransforms, QuaternionsGoTheShortWay) {
  const Skeleton skeleton(rigs::chain(1), Matrices{Matrix4<double>::Identity()});
  Matrices world;
  for (int frame = 0; frame < kFrames; ++frame) world.push_back(rigs::turn(100.0 * frame, {0, 1, 0}));
  const LocalTransforms found = split(skeleton, world);
  EXPECT_GT(found.rotations[0], 0);
  for (int frame = 1; frame < kFrames; ++frame) {
    double cosine = 0;
    for (int i = 0; i < 4; ++i) cosine += found.rotations[4 * frame + i] * found.rotations[4 * frame - 4 + i];
    EXPECT_NEAR(cosine, std::cos(50 * EIGEN_PI / 180), 1e-12) << frame;
  }
}

TEST(LocalTransforms, WhatShearsIsNearestAndItsHeadIsWhereItShouldBe) {
  const Skeleton skeleton(rigs::chain(2), Matrices{Matrix4<double>::Identity(), rigs::turn(30, {0, 0, 1}, {2, 0, 0})});
  Matrices world(2 * kFrames, Matrix4<double>::Identity());
  for (int frame = 0; frame < kFrames; ++frame) {
    world[2 * frame].diagonal() << 1, 3, 1, 1;
    world[2 * frame + 1] = rigs::turn(30, {0, 0, 1}, {2, 1, 0});  // rigid below what is stretched
  }
  const LocalTransforms found = split(skeleton, world);
  EXPECT_GT(distance({found.played[1]}, {world[1]}), 0.1);
  EXPECT_LT((found.played[1].col(3) - world[1].col(3)).norm(), 1e-12);
}

TEST(LocalTransforms, AMirrorScalesAllAxesBelow0) {
  const Skeleton skeleton(rigs::chain(1), Matrices{Matrix4<double>::Identity()});
  Matrices world(kFrames, rigs::turn(40, {1, 2, 3}));
  for (auto& matrix : world) matrix.col(0) *= -2;
  const LocalTransforms found = split(skeleton, world);
  EXPECT_LT(distance(found.played, world), 1e-12);
  for (const double scale : found.scales) EXPECT_LT(scale, 0);
}

TEST(LocalTransforms, JointsThatMayNotMoveKeepTheirLengthAndTheirChildrenFollow) {
  rigs::Random random(2);
  const Skeleton skeleton(rigs::chain(3), rigs::random_pose(random, 3));
  const Matrices world = posed(skeleton, random_locals(random, 3, 1, 1));
  const std::vector<std::uint8_t> may_move{1, 0, 1};
  const LocalTransforms found = split(skeleton, world, may_move);
  EXPECT_EQ(found.locations[3], 0);
  EXPECT_GT(distance({found.played[1]}, {world[1]}), 0.01);
  EXPECT_LT(distance({found.played[2]}, {world[2]}), 1e-11) << "what follows makes up for it";
}

TEST(LocalTransforms, HaveTheSameBitsWithAnyNumberOfThreads) {
  rigs::Random random(3);
  const Skeleton skeleton(rigs::random_forest(random, 30), rigs::random_pose(random, 30));
  const Matrices world = posed(skeleton, random_locals(random, 30, 0.5, 2));
  const ThreadsOfATest any_number;
  set_thread_count(1);
  const LocalTransforms one = split(skeleton, world);
  set_thread_count(4);
  const LocalTransforms many = split(skeleton, world);
  EXPECT_EQ(one.locations, many.locations);
  EXPECT_EQ(one.rotations, many.rotations);
  EXPECT_EQ(one.scales, many.scales);
  EXPECT_EQ(distance(one.played, many.played), 0);
}

TEST(LocalTransforms, SayWhatIsWrong) {
  const Skeleton skeleton(rigs::chain(2), rigs::identities(2));
  Matrices world(2 * kFrames, Matrix4<double>::Identity());
  EXPECT_EQ(complaint([&] { split(skeleton, Matrices(3 * kFrames, world[0])); }),
            "there are 3 matrices per frame; the skeleton has 2 joints");
  EXPECT_EQ(complaint([&] { split(skeleton, world, std::vector<std::uint8_t>{1}); }),
            "may_move has 1 values; the skeleton has 2 joints");
  world[7](0, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(complaint([&] { split(skeleton, world); }), "world: joint 1 is not at a finite place in frame 3");
  world[7] = Matrix4<double>::Zero();  // nothing follows it
  split(skeleton, world);
  world[6] = Matrix4<double>::Zero();
  EXPECT_EQ(complaint([&] { split(skeleton, world); }),
            "world: joint 0 has a scale of 0 along an axis in frame 3, and other joints follow it");
}

}  // namespace
}  // namespace sinew
