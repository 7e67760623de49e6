#include "rig/ik_tree.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "rig/rotation.h"

namespace sinew::rig {
namespace {

void solve(IkTreeSolver& solver, const IkTree& tree, std::span<Mat4> pose) {
  std::vector<DampedLeastSquares*> memory;
  solver.begin(tree, pose);
  IkTreeSolver::move(std::array{&solver}, memory);
  solver.finish(tree, pose);
}

/// Bones of length 1 up the Y axis, bent a little about X so that the solver knows where to.
struct Arm {
  explicit Arm(int count, float bend = 0.1F) {
    for (int i = 0; i < count; ++i) {
      IkBone bone;
      bone.parent = i - 1;
      bone.rest = kIdentity3;
      bone.length = 1;
      tree.bones.push_back(bone);
      const Mat4 local = widened(axis_rotation({1, 0, 0}, bend), {0, i == 0 ? 0.0F : 1.0F, 0});
      pose.push_back(i == 0 ? local : pose[i - 1] * local);
    }
    tree.goals.resize(1);
    tree.goals[0].tip = count - 1;
  }

  Vec3 solved() {
    IkTreeSolver solver;
    solve(solver, tree, pose);
    return tip(tree.goals[0].tip);
  }
  Vec3 tip(int bone) const { return pose[bone].location() + pose[bone].axis(1) * tree.bones[bone].length; }

  IkTree tree;
  std::vector<Mat4> pose;
};

void expect_near(const Vec3& found, const Vec3& expected, float tolerance = 2e-3F) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(found[i], expected[i], tolerance) << i;
}

TEST(IkTree, ReachesItsTarget) {
  for (const int count : {1, 2, 3, 6}) {
    Arm arm(count);
    const Vec3 target = count == 1 ? Vec3{0, 0.6F, 0.8F} : Vec3{0.5F, 0.9F, 0.7F};
    arm.tree.goals[0].target.set_location(target);
    expect_near(arm.solved(), target);
    for (int i = 1; i < count; ++i) expect_near(arm.pose[i].location(), arm.tip(i - 1), 1e-5F);
  }
}

TEST(IkTree, TheObjectsMatrixAndTheRootsParentDoNotChangeWhatIsReached) {
  Arm arm(3);
  arm.tree.object = widened(axis_rotation({0, 0, 1}, 1), {4, 5, 6});
  arm.tree.has_parent = true;
  arm.tree.parent = widened(axis_rotation({0, 1, 0}, 2), {0, -1, 0});
  arm.tree.goals[0].target = arm.tree.object * widened(kIdentity3, {0.5F, 0.9F, 0.7F});
  expect_near(arm.solved(), {0.5F, 0.9F, 0.7F});
}

TEST(IkTree, StretchesOnlyIfItMay) {
  Arm stiff(2), elastic(2);
  for (Arm* arm : {&stiff, &elastic}) {
    arm->tree.goals[0].target.set_location({0, 3, 0});
    for (IkBone& bone : arm->tree.bones) bone.stretch = arm == &elastic ? 0.5F : 0.0F;
  }
  EXPECT_NEAR(length(stiff.solved()), 2, 1e-2);
  EXPECT_GT(length(elastic.solved()), 2.5);
  elastic = Arm(2);
  elastic.tree.is_stretching = false;
  elastic.tree.bones[0].stretch = 0.5F;
  elastic.tree.goals[0].target.set_location({0, 3, 0});
  EXPECT_LT(length(elastic.solved()), 2.01F);
}

TEST(IkTree, LockedAxesStayAndLimitsHold) {
  Arm arm(2, 0.2F);
  for (IkBone& bone : arm.tree.bones) bone.is_locked = {false, true, true};
  arm.tree.goals[0].target.set_location({0.8F, 1, 0.5F});
  EXPECT_NEAR(arm.solved()[0], 0, 1e-6) << "hinges about X stay in their plane";

  Arm limited(2, 0.2F);
  limited.tree.bones[1].is_locked = {false, true, true};
  limited.tree.bones[1].is_limited = {true, false, false};
  limited.tree.bones[1].lowest = {-0.3F, 0, 0};
  limited.tree.bones[1].highest = {0.3F, 0, 0};
  limited.tree.goals[0].target.set_location({0, 0.2F, 0.2F});
  limited.solved();
  const float cosine = dot(limited.pose[0].axis(1), limited.pose[1].axis(1));
  EXPECT_GT(cosine, std::cos(0.3F) - 1e-4F);

  Arm fixed(2, 0.2F);
  fixed.tree.bones[1].is_locked = {true, true, true};
  fixed.tree.goals[0].target.set_location({0, 0.2F, 0.2F});
  fixed.solved();
  // A bone whose axes are all locked keeps its own rotation: only what the solver changes is applied.
  EXPECT_NEAR(dot(fixed.pose[0].axis(1), fixed.pose[1].axis(1)), std::cos(0.2F), 0.03);
}

TEST(IkTree, ThePoleDecidesThePlane) {
  for (const float side : {-3.0F, 3.0F}) {
    Arm arm(2);
    arm.tree.goals[0].has_pole = true;
    arm.tree.goals[0].pole = {side, 0.5F, 0, 1};
    arm.tree.goals[0].target.set_location({0, 1.2F, 0});
    arm.tree.goals[0].pole_angle = kHalfPi;
    expect_near(arm.solved(), {0, 1.2F, 0});
    EXPECT_NEAR(arm.pose[1].location()[2], 0, 1e-2);
    EXPECT_GT(std::fabs(arm.pose[1].location()[0]), 0.5F);
  }
}

TEST(IkTree, RotationGoalsTurnTheTip) {
  Arm arm(4);
  arm.tree.goals[0].has_rotation = true;
  arm.tree.goals[0].target = widened(axis_rotation({1, 0, 0}, 0.9F), {0, 2, 1});
  expect_near(arm.solved(), {0, 2, 1}, 1e-2F);
  expect_near(arm.pose[3].axis(1), {0, std::cos(0.9F), std::sin(0.9F)}, 2e-2F);
}

TEST(IkTree, InfluenceBlends) {
  Arm half(3);
  const Vec3 start = half.tip(2), target{0.5F, 0.9F, 0.7F};
  half.tree.goals[0].influence = 0.5F;
  half.tree.goals[0].target.set_location(target);
  expect_near(half.solved(), (start + target) * 0.5F);
}

TEST(IkTree, TwoArmsOfOneRootReachBoth) {
  Arm arm(3);
  IkBone branch = arm.tree.bones[2];
  branch.parent = 0;
  const Mat4 first = arm.pose[0] * widened(axis_rotation({0, 0, 1}, 0.4F), {0, 1, 0});
  arm.tree.bones.push_back(branch);
  arm.pose.push_back(first);
  arm.tree.goals.resize(2);
  arm.tree.goals[0].target.set_location({0, 1.8F, 1.6F});
  arm.tree.goals[1].tip = 3;
  arm.tree.goals[1].target.set_location({-0.6F, 1.5F, 0.5F});
  expect_near(arm.solved(), {0, 1.8F, 1.6F}, 2e-2F);
  expect_near(arm.tip(3), {-0.6F, 1.5F, 0.5F}, 2e-2F);
}

TEST(IkTree, WithSeveralPlacesToReachAPoleDoesNotCount) {
  std::vector<Mat4> poses[2];
  for (const bool has_pole : {false, true}) {
    Arm arm(3);
    arm.tree.goals.resize(2);
    arm.tree.goals[0].target.set_location({0, 1.8F, 1.6F});
    arm.tree.goals[0].has_pole = has_pole;
    arm.tree.goals[0].pole = {3, 0.5F, 0, 1};
    arm.tree.goals[1].tip = 1;
    arm.tree.goals[1].target.set_location({-0.2F, 1.5F, 0.8F});
    arm.solved();
    poses[has_pole] = arm.pose;
  }
  EXPECT_EQ(poses[0], poses[1]);
}

TEST(IkTree, KeepsNothingFromSolveToSolve) {
  IkTreeSolver solver;
  Arm a(4), b(2), again(4);
  for (Arm* arm : {&a, &b, &again}) arm->tree.goals[0].target.set_location({0.5F, 0.9F, 0.7F});
  solve(solver, a.tree, a.pose);
  solve(solver, b.tree, b.pose);
  solve(solver, again.tree, again.pose);
  EXPECT_EQ(a.pose, again.pose);
}

TEST(IkTree, StepsAreRoundedAsByTheEigenOfEachBlender) {
  constexpr int kDofs = 15;
  int differing = 0;
  for (int trial = 0; trial < 10; ++trial) {
    DampedLeastSquares systems[2];
    for (const bool eigen_5 : {false, true}) {
      DampedLeastSquares& system = systems[eigen_5];
      system.reset(3, kDofs, eigen_5);
      for (int dof = 0; dof < kDofs; ++dof) {
        const double x = kDofs * trial + dof;
        system.set_column(0, dof, {std::sin(x), std::cos(3 * x), std::sin(7 * x)}, false);
      }
      system.set_residual(0, {0.1, -0.2, 0.15});
      system.solve();
    }
    for (int dof = 0; dof < kDofs; ++dof) {
      EXPECT_NEAR(systems[0].step(dof), systems[1].step(dof), 1e-12);
      differing += systems[0].step(dof) != systems[1].step(dof);
    }
  }
  EXPECT_GT(differing, 0);
}

TEST(IkTree, SeveralAtATimeAreAsEachAlone) {
  for (const int most : {2, 3, 7}) {
    std::vector<Arm> arms;
    for (int i = 0; i < most; ++i) {
      Arm arm(i == 4 ? 3 : 2, 0.1F + 0.2F * static_cast<float>(i));
      // The third one cannot reach its target, which takes longest.
      arm.tree.goals[0].target.set_location({0.5F, i == 2 ? 9.0F : 0.9F, 0.1F * static_cast<float>(i)});
      for (IkBone& bone : arm.tree.bones) bone.stretch = i % 2 == 0 ? 0 : 0.1F;
      arms.push_back(arm);
    }
    std::vector<Arm> alone = arms;
    std::vector<IkTreeSolver> solvers(arms.size());
    std::vector<IkTreeSolver*> all;
    std::vector<DampedLeastSquares*> memory;
    for (std::size_t i = 0; i < arms.size(); ++i) {
      solvers[i].begin(arms[i].tree, arms[i].pose);
      all.push_back(&solvers[i]);
    }
    IkTreeSolver::move(all, memory);
    for (std::size_t i = 0; i < arms.size(); ++i) {
      solvers[i].finish(arms[i].tree, arms[i].pose);
      alone[i].solved();
      EXPECT_EQ(arms[i].pose, alone[i].pose) << "arm " << i << " of " << most;
    }
  }
}

TEST(IkTree, BadNumbersEnd) {
  for (const float number : {NAN, INFINITY, 3e38F, 0.0F}) {
    Arm arm(3);
    arm.tree.bones[1].length = number;
    arm.tree.bones[2].stretch = number;
    arm.tree.goals[0].target.set_location({number, 1, 0});
    arm.solved();
  }
}

}  // namespace
}  // namespace sinew::rig
