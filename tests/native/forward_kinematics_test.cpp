#include "sinew/forward_kinematics.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "rigs.h"

namespace sinew {
namespace {

using rigs::Layout;
using rigs::Matrices;
using rigs::Stack;

template <class T>
class ForwardKinematics : public testing::Test {
 protected:
  /// Against numbers of the size of `expected`.
  void expect_near(const std::vector<Matrix4<T>>& result, const Matrices& expected, double ulps) {
    ASSERT_EQ(result.size(), expected.size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      const double error = (result[i].template cast<double>() - expected[i]).cwiseAbs().maxCoeff();
      const double size = expected[i].cwiseAbs().maxCoeff();
      EXPECT_LE(error, ulps * std::numeric_limits<T>::epsilon() * size) << "joint " << i;
    }
  }

  std::vector<Matrix4<T>> run(const Skeleton& skeleton, const Matrices& local, std::ptrdiff_t frames = 1,
                              Layout in = Layout::column_major, Layout out = Layout::column_major) {
    Stack<T> source(local, frames, in), world(frames, skeleton.joint_count(), out);
    forward_kinematics(skeleton, source.read(), world.view());
    return world.matrices();
  }
};

using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(ForwardKinematics, Scalars);

TYPED_TEST(ForwardKinematics, TwoJointsByHand) {
  // A bone of length 2 along x, turned by 90 degrees about z at its root; the next turned back.
  const Matrices rest{Matrix4<double>::Identity(), rigs::turn(0, {1, 0, 0}, {2, 0, 0})};
  const Skeleton skeleton(rigs::chain(2), rest);
  const Matrices local{rigs::turn(90, {0, 0, 1}), rigs::turn(-90, {0, 0, 1})};
  const auto world = this->run(skeleton, local);
  this->expect_near(world, {local[0], rigs::turn(0, {0, 0, 1}, {0, 2, 0})}, 4);
}

TYPED_TEST(ForwardKinematics, RestPoseIsTheRestOfTheWorld) {
  rigs::Random random(1);
  const auto parents = rigs::random_forest(random, 50);
  const Skeleton skeleton(parents, rigs::random_pose(random, 50));
  const Matrices expected(skeleton.rest_world().begin(), skeleton.rest_world().end());
  this->expect_near(this->run(skeleton, rigs::identities(50)), expected, 64);
}

TYPED_TEST(ForwardKinematics, ChainsOf1To512Joints) {
  rigs::Random random(2);
  for (const std::int32_t count : {1, 2, 3, 4, 7, 8, 9, 31, 64, 100, 511, 512}) {
    const auto parents = rigs::chain(count);
    const Matrices rest = rigs::random_pose(random, count);
    const Matrices local = rigs::random_pose(random, count);
    const auto world = this->run(Skeleton(parents, rest), local);
    this->expect_near(world, reference::forward_kinematics(parents, rest, local), 16.0 * count);
  }
}

TYPED_TEST(ForwardKinematics, TreesAndForests) {
  rigs::Random random(3);
  for (const std::int32_t count : {2, 23, 300}) {
    for (const auto& parents : {rigs::bushy_tree(count, 6), rigs::random_forest(random, count)}) {
      const Matrices rest = rigs::random_pose(random, count);
      const Matrices local = rigs::random_pose(random, count);
      const auto world = this->run(Skeleton(parents, rest), local);
      this->expect_near(world, reference::forward_kinematics(parents, rest, local), 256);
    }
  }
}

TYPED_TEST(ForwardKinematics, OneRigidTransformMovesEverything) {
  rigs::Random random(4);
  const auto parents = rigs::random_forest(random, 40);
  const Matrices rest = rigs::random_pose(random, 40);
  const Skeleton skeleton(parents, rest);
  Matrices local = rigs::random_pose(random, 40);
  Matrices expected = reference::forward_kinematics(parents, rest, local);
  const Matrix4<double> moved = rigs::random_rigid(random);
  for (auto& world : expected) world = moved * world;
  for (int j = 0; j < 40; ++j) {
    if (parents[j] < 0) local[j] = rest[j].inverse() * moved * rest[j] * local[j];
  }
  this->expect_near(this->run(skeleton, local), expected, 256);
}

TYPED_TEST(ForwardKinematics, FramesAtOnceAreFrameByFrame) {
  rigs::Random random(5);
  constexpr int kFrames = 150, kJoints = 30;
  const Skeleton skeleton(rigs::random_forest(random, kJoints), rigs::random_pose(random, kJoints));
  const Matrices local = rigs::random_pose(random, kFrames * kJoints);
  const auto at_once = this->run(skeleton, local, kFrames);
  for (int frame = 0; frame < kFrames; ++frame) {
    const auto begin = local.begin() + frame * kJoints;
    const auto single = this->run(skeleton, Matrices(begin, begin + kJoints));
    EXPECT_TRUE(std::equal(single.begin(), single.end(), at_once.begin() + frame * kJoints));
  }
}

TYPED_TEST(ForwardKinematics, EveryLayoutGivesTheSameBits) {
  rigs::Random random(6);
  const Skeleton skeleton(rigs::random_forest(random, 20), rigs::random_pose(random, 20));
  const Matrices local = rigs::random_pose(random, 3 * 20);
  const auto expected = this->run(skeleton, local, 3);
  for (const Layout in : rigs::kLayouts) {
    for (const Layout out : rigs::kLayouts) {
      EXPECT_EQ(this->run(skeleton, local, 3, in, out), expected);
    }
  }
}

TYPED_TEST(ForwardKinematics, WorksInPlace) {
  rigs::Random random(7);
  const Skeleton skeleton(rigs::random_forest(random, 20), rigs::random_pose(random, 20));
  for (const int frames : {1, 4}) {
    const Matrices local = rigs::random_pose(random, frames * 20);
    for (const Layout layout : rigs::kLayouts) {
      Stack<TypeParam> stack(local, frames, layout);
      forward_kinematics(skeleton, stack.read(), stack.view());
      EXPECT_EQ(stack.matrices(), this->run(skeleton, local, frames));
    }
  }
}

TYPED_TEST(ForwardKinematics, AnyNumberOfThreadsGivesTheSameBits) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(8);
  // A trunk and many groups, and many frames.
  const Skeleton wide(rigs::bushy_tree(9000, 60), rigs::random_pose(random, 9000));
  const Matrices wide_pose = rigs::random_pose(random, 9000);
  const Skeleton narrow(rigs::random_forest(random, 90), rigs::random_pose(random, 90));
  const Matrices clip = rigs::random_pose(random, 100 * 90);
  set_thread_count(1);
  const auto one_wide = this->run(wide, wide_pose);
  const auto one_clip = this->run(narrow, clip, 100);
  for (const int threads : {2, 3, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(this->run(wide, wide_pose), one_wide);
    EXPECT_EQ(this->run(narrow, clip, 100), one_clip);
  }
}

TYPED_TEST(ForwardKinematics, NothingIsFine) {
  const Skeleton empty(std::vector<std::int32_t>{}, Matrices{});
  Stack<TypeParam> none(3, 0);
  forward_kinematics(empty, none.read(), none.view());
  const Skeleton one(rigs::chain(1), rigs::identities(1));
  Stack<TypeParam> no_frames(0, 1);
  forward_kinematics(one, no_frames.read(), no_frames.view());
}

TYPED_TEST(ForwardKinematics, RefusesShapesThatDoNotFit) {
  const Skeleton skeleton(rigs::chain(3), rigs::identities(3));
  Stack<TypeParam> two(1, 2), three(1, 3), frames(2, 3);
  Stack<float> out_three(1, 3), out_frames(2, 3);
  const std::string too_few = "there are 2 matrices per frame; the skeleton has 3 joints";
  const std::string wrong_out = "the result holds 2 x 3 matrices; expected 1 x 3";
  EXPECT_EQ(complaint([&] { forward_kinematics(skeleton, two.read(), three.view()); }), too_few);
  EXPECT_EQ(complaint([&] { forward_kinematics(skeleton, three.read(), frames.view()); }), wrong_out);
  EXPECT_EQ(complaint([&] { skinning_matrices(skeleton, two.read(), out_three.view()); }), too_few);
  EXPECT_EQ(complaint([&] { skinning_matrices(skeleton, three.read(), out_frames.view()); }), wrong_out);
  EXPECT_EQ(complaint([&] { forward_kinematics(skeleton, three.read(), two.view()); }),
            "the result holds 1 x 2 matrices; expected 1 x 3");
}

TYPED_TEST(ForwardKinematics, SkinningMatricesAtRestAreTheIdentity) {
  rigs::Random random(9);
  const Skeleton skeleton(rigs::random_forest(random, 50), rigs::random_pose(random, 50));
  Stack<TypeParam> local(rigs::identities(50), 1), world(1, 50);
  Stack<float> matrices(1, 50);
  forward_kinematics(skeleton, local.read(), world.view());
  skinning_matrices(skeleton, world.read(), matrices.view());
  for (const auto& matrix : matrices.matrices()) {
    EXPECT_LT((matrix - Matrix4<float>::Identity()).cwiseAbs().maxCoeff(), 1e-5f);
  }
}

TYPED_TEST(ForwardKinematics, SkinningMatricesAgainstTheFormula) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(10);
  constexpr int kFrames = 60, kJoints = 50;
  const auto parents = rigs::random_forest(random, kJoints);
  const Matrices rest = rigs::random_pose(random, kJoints);
  const Skeleton skeleton(parents, rest);
  const Matrices bind = reference::forward_kinematics(parents, rest, rigs::identities(kJoints));
  const Matrices posed = rigs::random_pose(random, kFrames * kJoints);
  std::vector<Matrix4<float>> first;
  for (const Layout layout : rigs::kLayouts) {
    for (const int threads : {1, 2, 3, 8}) {
      set_thread_count(threads);
      Stack<TypeParam> world(posed, kFrames, layout);
      Stack<float> matrices(kFrames, kJoints, layout);
      skinning_matrices(skeleton, world.read(), matrices.view());
      if (first.empty()) first = matrices.matrices();
      EXPECT_EQ(matrices.matrices(), first);
    }
  }
  for (std::size_t i = 0; i < first.size(); ++i) {
    const Matrix4<double> expected = posed[i] * bind[i % kJoints].inverse();
    EXPECT_LT((first[i].cast<double>() - expected).cwiseAbs().maxCoeff(),
              4e-7 * bind[i % kJoints].cwiseAbs().maxCoeff());
  }
}

}  // namespace
}  // namespace sinew
