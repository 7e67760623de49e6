#include "sinew/skeleton.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "rigs.h"

namespace sinew {
namespace {

using rigs::Matrices;
using Parents = std::vector<std::int32_t>;

/// Every joint once, its parent in the level before.
void expect_levels(const Skeleton& skeleton) {
  const auto order = skeleton.order();
  const auto begin = skeleton.level_begin();
  ASSERT_EQ(begin.front(), 0);
  ASSERT_EQ(begin.back(), skeleton.joint_count());
  std::vector<std::ptrdiff_t> level_of(skeleton.joint_count(), -1);
  for (std::size_t level = 0; level + 1 < begin.size(); ++level) {
    EXPECT_LT(begin[level], begin[level + 1]);
    for (auto i = begin[level]; i < begin[level + 1]; ++i) {
      ASSERT_EQ(level_of[order[i]], -1) << "joint " << order[i] << " comes twice";
      level_of[order[i]] = static_cast<std::ptrdiff_t>(level);
      const auto parent = skeleton.parents()[order[i]];
      ASSERT_EQ(parent < 0 ? -1 : level_of[parent], static_cast<std::ptrdiff_t>(level) - 1);
    }
  }
}

TEST(Skeleton, OrderPutsParentsFirstLevelByLevel) {
  rigs::Random random(1);
  for (const std::int32_t count : {1, 2, 3, 17, 300}) {
    const Matrices rest = rigs::identities(count);
    expect_levels(Skeleton(rigs::chain(count), rest));
    expect_levels(Skeleton(rigs::bushy_tree(count, 5), rest));
    expect_levels(Skeleton(rigs::random_forest(random, count), rest));
  }
}

TEST(Skeleton, KeepsTheCallersNumbers) {
  const Parents parents{2, -1, 1, -1};
  rigs::Random random(2);
  const Matrices rest = rigs::random_pose(random, 4);
  const Skeleton skeleton(parents, rest);
  EXPECT_EQ(skeleton.joint_count(), 4);
  EXPECT_TRUE(std::ranges::equal(skeleton.parents(), parents));
  EXPECT_TRUE(std::ranges::equal(skeleton.rest<double>(), rest));
  for (int j = 0; j < 4; ++j) EXPECT_EQ(skeleton.rest<float>()[j], rest[j].cast<float>());
  EXPECT_TRUE(std::ranges::equal(skeleton.order(), Parents{1, 3, 2, 0}));
  EXPECT_TRUE(std::ranges::equal(skeleton.level_begin(), Parents{0, 2, 3, 4}));
}

TEST(Skeleton, RestInTheWorldAndItsInverse) {
  rigs::Random random(3);
  const Parents parents = rigs::random_forest(random, 60);
  const Matrices rest = rigs::random_pose(random, 60);
  const Skeleton skeleton(parents, rest);
  const Matrices world = reference::forward_kinematics(parents, rest, rigs::identities(60));
  for (int j = 0; j < 60; ++j) {
    EXPECT_LT((skeleton.rest_world()[j] - world[j]).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((skeleton.inverse_rest()[j] * world[j] - Matrix4<double>::Identity()).norm(), 1e-12);
  }
}

TEST(Skeleton, MayBeEmpty) {
  const Skeleton skeleton(Parents{}, Matrices{});
  EXPECT_EQ(skeleton.joint_count(), 0);
  EXPECT_TRUE(std::ranges::equal(skeleton.level_begin(), Parents{0}));
}

TEST(Skeleton, RefusesSizesThatDiffer) {
  EXPECT_EQ(complaint([] {
              Skeleton(Parents{-1, 0}, rigs::identities(1));
            }),
            "there are 2 parents and 1 rest transform; expected one of each a joint");
}

TEST(Skeleton, RefusesAParentThatDoesNotExist) {
  for (const std::int32_t parent : {-2, 3, std::numeric_limits<std::int32_t>::min(),
                                    std::numeric_limits<std::int32_t>::max()}) {
    EXPECT_EQ(complaint([&] {
                Skeleton(Parents{-1, parent, 1}, rigs::identities(3));
              }),
              "joint 1 has parent " + std::to_string(parent) + "; expected -1 (a root) to 2");
  }
}

TEST(Skeleton, RefusesCycles) {
  const auto said = [](const Parents& parents) {
    return complaint(
        [&] { Skeleton(parents, rigs::identities(static_cast<std::ptrdiff_t>(parents.size()))); });
  };
  const std::string is_cycle = " is its own ancestor: its chain of parents is a cycle";
  EXPECT_EQ(said({0}), "joint 0" + is_cycle);
  EXPECT_EQ(said({-1, 2, 1}), "joint 1" + is_cycle);
  EXPECT_EQ(said({1, 2, 3, 0}), "joint 0" + is_cycle);
}

TEST(Skeleton, RefusesNumbersThatAreNotFinite) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Matrices rest = rigs::identities(3);
    rest[2](1, 3) = bad;
    EXPECT_EQ(complaint([&] { Skeleton(rigs::chain(3), rest); }),
              "the rest transform of joint 2 holds a number that is not finite");
  }
}

TEST(Skeleton, RefusesARestTransformWithoutAnInverse) {
  Matrices rest = rigs::identities(3);
  rest[1](0, 0) = 0;
  EXPECT_EQ(complaint([&] { Skeleton(rigs::chain(3), rest); }),
            "the rest transform of joint 1 cannot be inverted");
}

}  // namespace
}  // namespace sinew
