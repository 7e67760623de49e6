#include "sinew/pose_clip.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "rigs.h"

namespace sinew {
namespace {

using Quaternions = std::vector<Eigen::Quaterniond>;

Eigen::Quaterniond about_z(double degrees) {
  return Eigen::Quaterniond(rigs::turn(degrees, {0, 0, 1}).topLeftCorner<3, 3>());
}

Eigen::Quaterniond sampled(const PoseClip& clip, double time, bool loop = false) {
  Quaternions rotations(clip.joint_count());
  clip.sample(time, loop, rotations);
  return rotations.back();
}

/// As rotations: q and -q are the same.
void expect_rotation(const Eigen::Quaterniond& q, const Eigen::Quaterniond& expected) {
  EXPECT_NEAR(q.norm(), 1, 1e-12);
  EXPECT_LT(q.angularDistance(expected), 1e-7);
}

TEST(PoseClip, BringsQuaternionsToUnitLength) {
  const PoseClip clip(2, {{2, 0, 0, 0}, {0, 0, -3, 0}, {1, 1, 1, 1}, {1e-8, 0, 0, 0}});
  EXPECT_EQ(clip.joint_count(), 2);
  EXPECT_EQ(clip.pose_count(), 2);
  ASSERT_EQ(clip.rotations().size(), 4u);
  EXPECT_EQ(clip.rotations()[1].coeffs(), Eigen::Quaterniond(0, 0, -1, 0).coeffs());
  EXPECT_EQ(clip.rotations()[2].coeffs(), Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5).coeffs());
  EXPECT_EQ(clip.rotations()[3].coeffs(), Eigen::Quaterniond(1, 0, 0, 0).coeffs());
}

TEST(PoseClip, RefusesWhatIsNoClip) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto said = [](std::ptrdiff_t joints, const Quaternions& rotations) {
    return complaint([&] { PoseClip(joints, rotations); });
  };
  const Eigen::Quaterniond one(1, 0, 0, 0);
  const std::string expected = "; expected one per joint for each of at least one pose";
  EXPECT_EQ(said(2, {one, one, one}), "there are 3 rotations for 2 joints" + expected);
  EXPECT_EQ(said(2, {}), "there are 0 rotations for 2 joints" + expected);
  EXPECT_EQ(said(0, {}), "there are 0 rotations for 0 joints" + expected);
  EXPECT_EQ(said(-1, {one}), "there are 1 rotation for -1 joints" + expected);
  EXPECT_EQ(said(2, {one, one, one, {0, 0, 0, 0}}), "the quaternion of joint 1 in pose 1 has length 0; expected 1");
  EXPECT_EQ(said(1, {{1, nan, 0, 0}}), "the quaternion of joint 0 in pose 0 has length nan; expected 1");
}

TEST(PoseClip, TableOfQuaternionsInBothOrders) {
  Eigen::MatrixXd table(8, 2);
  table << 1, 0.5, 0, 0.5, 0, 0.5, 0, -0.5, 0, 0.6, 0.8, 0, 0.6, 0, 0, 0.8;
  const PoseClip wxyz = PoseClip::from_table(table, 2);
  EXPECT_EQ(wxyz.pose_count(), 2);
  EXPECT_EQ(wxyz.rotations()[1].coeffs(), Eigen::Quaterniond(0, 0.8, 0.6, 0).coeffs());
  EXPECT_EQ(wxyz.rotations()[2].coeffs(), Eigen::Quaterniond(0.5, 0.5, 0.5, -0.5).coeffs());
  EXPECT_LT((wxyz.to_table() - table).cwiseAbs().maxCoeff(), 1e-15);
  const PoseClip xyzw = PoseClip::from_table(table, 2, QuaternionOrder::xyzw);
  EXPECT_EQ(xyzw.rotations()[1].coeffs(), Eigen::Quaterniond(0, 0, 0.8, 0.6).coeffs());
}

TEST(PoseClip, TableOfEulerAnglesTurnsAboutXThenYThenZ) {
  Eigen::MatrixXd table(6, 1);
  table << 0, 0, 90, 30, -40, 50;
  const PoseClip clip = PoseClip::from_table(table, 2);
  expect_rotation(clip.rotations()[0], about_z(90));
  const Matrix4<double> expected = rigs::turn(50, {0, 0, 1}) * rigs::turn(-40, {0, 1, 0}) * rigs::turn(30, {1, 0, 0});
  expect_rotation(clip.rotations()[1], Eigen::Quaterniond(expected.topLeftCorner<3, 3>()));
}

TEST(PoseClip, RefusesTablesThatDoNotFit) {
  EXPECT_EQ(complaint([] { PoseClip::from_table(Eigen::MatrixXd::Ones(10, 1), 3); }),
            "there are 10 numbers per pose; expected 9 (Euler angles) or 12 (quaternions) for 3 joints");
  EXPECT_EQ(complaint([] { PoseClip::from_table(Eigen::MatrixXd::Ones(12, 0), 3); }),
            "there are 0 rotations for 3 joints; expected one per joint for each of at least one pose");
  EXPECT_EQ(complaint([] { PoseClip::from_table(Eigen::MatrixXd::Zero(4, 1), 1); }),
            "the quaternion of joint 0 in pose 0 has length 0; expected 1");
}

TEST(PoseClip, SamplesBetweenPoses) {
  const PoseClip clip(1, {about_z(0), about_z(60), about_z(-30)});
  for (const auto& [time, degrees] : {std::pair{0.0, 0.0}, {0.5, 30}, {1, 60}, {1.25, 37.5}, {2, -30}}) {
    expect_rotation(sampled(clip, time), about_z(degrees));
  }
  EXPECT_EQ(sampled(clip, 1).coeffs(), clip.rotations()[1].coeffs());
}

TEST(PoseClip, TimeStopsAtEitherEnd) {
  const PoseClip clip(1, {about_z(10), about_z(60)});
  for (const double time : {-0.5, -1e300}) expect_rotation(sampled(clip, time), about_z(10));
  for (const double time : {1.0, 1.5, 1e300}) expect_rotation(sampled(clip, time), about_z(60));
}

TEST(PoseClip, LoopingTimeWrapsAtTheNumberOfPoses) {
  const PoseClip clip(1, {about_z(0), about_z(60), about_z(-30)});
  for (const double turns : {0.0, 3.0, -3.0, 300.0}) {
    expect_rotation(sampled(clip, turns + 1, true), about_z(60));
    expect_rotation(sampled(clip, turns + 2.5, true), about_z(-15));  // from the last to the first
  }
  expect_rotation(sampled(clip, -1e-20, true), about_z(0));
  expect_rotation(sampled(PoseClip(1, {about_z(10)}), 0.7, true), about_z(10));
}

TEST(PoseClip, LoopingTimeIsSafeHoweverLarge) {
  const PoseClip clip(1, {about_z(0), about_z(10), about_z(20), about_z(30), about_z(40), about_z(50), about_z(60)});
  for (double time = 1; time < 1e308; time *= 7.3) {
    for (const double signed_time : {time, -time}) {
      EXPECT_NEAR(sampled(clip, signed_time, true).norm(), 1, 1e-12) << signed_time;
    }
  }
}

TEST(PoseClip, TakesTheShortWayRound) {
  Eigen::Quaterniond minus = about_z(60);
  minus.coeffs() = -minus.coeffs();
  expect_rotation(sampled(PoseClip(1, {about_z(0), minus}), 0.5), about_z(30));
}

TEST(PoseClip, RefusesATimeThatIsNotFiniteAndAResultThatDoesNotFit) {
  const PoseClip clip(2, {about_z(0), about_z(0)});
  Quaternions two(2), three(3);
  EXPECT_EQ(complaint([&] { clip.sample(std::numeric_limits<double>::infinity(), true, two); }),
            "the time of a pose is inf; expected a finite number");
  EXPECT_EQ(complaint([&] { clip.sample(0, false, three); }), "the result holds 3 rotations; the clip has 2 joints");
}

template <class T>
class RotationTransforms : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(RotationTransforms, Scalars);

TYPED_TEST(RotationTransforms, TurnAboutTheirOrigin) {
  for (const auto layout : rigs::kLayouts) {
    rigs::Stack<TypeParam> local(1, 2, layout);
    rotation_transforms(Quaternions{about_z(90), about_z(0)}, local.view());
    const double tolerance = 2 * std::numeric_limits<TypeParam>::epsilon();
    const Matrix4<double> turned = local.matrices()[0].template cast<double>();
    EXPECT_LT((turned - rigs::turn(90, {0, 0, 1})).cwiseAbs().maxCoeff(), tolerance);
    EXPECT_EQ(local.matrices()[1], Matrix4<TypeParam>::Identity());
  }
}

TYPED_TEST(RotationTransforms, RefuseAShapeThatDoesNotFit) {
  rigs::Stack<TypeParam> three(1, 3), frames(2, 2);
  const Quaternions two{about_z(0), about_z(0)};
  EXPECT_EQ(complaint([&] { rotation_transforms(two, three.view()); }),
            "the result holds 1 x 3 matrices; expected 1 x 2");
  EXPECT_EQ(complaint([&] { rotation_transforms(two, frames.view()); }),
            "the result holds 2 x 2 matrices; expected 1 x 2");
}

}  // namespace
}  // namespace sinew
