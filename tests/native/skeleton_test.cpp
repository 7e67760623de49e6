#include "sinew/skeleton.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "rigs.h"

namespace sinew {
namespace {

using rigs::Matrices;
using Parents = std::vector<std::int32_t>;

/// Every joint once, after its parent, which is in the trunk or in the same group.
void expect_groups(const Skeleton& skeleton) {
  const auto order = skeleton.grouped_order();
  const auto begin = skeleton.group_begin();
  ASSERT_EQ(std::ssize(order), skeleton.joint_count());
  ASSERT_EQ(begin.back(), skeleton.joint_count());
  std::vector<std::ptrdiff_t> group_of(skeleton.joint_count(), -2);
  for (std::ptrdiff_t group = -1; group + 1 < std::ssize(begin); ++group) {
    const std::int32_t first = group < 0 ? 0 : begin[group];
    EXPECT_TRUE(group < 0 || first < begin[group + 1]);
    EXPECT_TRUE(group < 0 || begin[group + 1] - first <= Skeleton::kLargestGroup);
    for (auto i = first; i < begin[group + 1]; ++i) {
      ASSERT_EQ(group_of[order[i]], -2) << "joint " << order[i] << " comes twice";
      group_of[order[i]] = group;
      const auto parent = skeleton.parents()[order[i]];
      ASSERT_TRUE(parent < 0 || group_of[parent] == -1 || group_of[parent] == group);
    }
  }
}

TEST(Skeleton, OrderIsATrunkAndGroupsOfSubtrees) {
  rigs::Random random(1);
  for (const std::int32_t count : {1, 2, 3, 17, 300, 512, 513, 5000}) {
    const Matrices rest = rigs::identities(count);
    expect_groups(Skeleton(rigs::chain(count), rest));
    expect_groups(Skeleton(rigs::bushy_tree(count, 5), rest));
    expect_groups(Skeleton(rigs::random_forest(random, count), rest));
    expect_groups(Skeleton(Parents(count, -1), rest));
  }
}

TEST(Skeleton, OrderIsByNumberWhereThatWillDo) {
  const auto order = [](const Parents& parents) {
    const auto rest = rigs::identities(std::ssize(parents));
    const Skeleton skeleton(parents, rest);
    return Parents(skeleton.order().begin(), skeleton.order().end());
  };
  EXPECT_EQ(order({-1, 0, -1, 0, 2}), (Parents{0, 1, 2, 3, 4}));
  EXPECT_EQ(order({3, 0, -1, 2}), (Parents{2, 3, 0, 1}));
}

TEST(Skeleton, TrunkIsNoLongerThanItMustBe) {
  const std::int32_t largest = Skeleton::kLargestGroup;
  const auto groups = [](const Parents& parents) {
    const auto rest = rigs::identities(std::ssize(parents));
    const Skeleton skeleton(parents, rest);
    const auto begin = skeleton.group_begin();
    return Parents(begin.begin(), begin.end());
  };
  EXPECT_EQ(groups(rigs::chain(largest)), (Parents{0, largest}));
  EXPECT_EQ(groups(rigs::chain(largest + 3)), (Parents{3, largest + 3}));
  // A root with thousands of children, which are dealt to full groups.
  Parents star(2 * largest + 2, 0);
  star[0] = -1;
  EXPECT_EQ(groups(star), (Parents{1, largest + 1, 2 * largest + 1, 2 * largest + 2}));
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
  EXPECT_TRUE(std::ranges::equal(skeleton.order(), Parents{1, 2, 0, 3}));
  EXPECT_TRUE(std::ranges::equal(skeleton.group_begin(), Parents{0, 4}));
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
  EXPECT_TRUE(std::ranges::equal(skeleton.group_begin(), Parents{0}));
}

TEST(Skeleton, RefusesSizesThatDiffer) {
  EXPECT_EQ(complaint([] {
              Skeleton(Parents{-1, 0}, rigs::identities(1));
            }),
            "there are 2 parents and 1 rest transform; expected one of each per joint");
}

TEST(Skeleton, RefusesAParentThatDoesNotExist) {
  for (const std::int32_t parent :
       {-2, 3, std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()}) {
    EXPECT_EQ(complaint([&] {
                Skeleton(Parents{-1, parent, 1}, rigs::identities(3));
              }),
              "joint 1 has parent " + std::to_string(parent) + "; expected -1 (a root) to 2");
  }
}

TEST(Skeleton, RefusesCycles) {
  const auto said = [](const Parents& parents) {
    return complaint([&] { Skeleton(parents, rigs::identities(static_cast<std::ptrdiff_t>(parents.size()))); });
  };
  const std::string is_cycle = " is its own ancestor: its chain of parents is a cycle";
  EXPECT_EQ(said({0}), "joint 0" + is_cycle);
  EXPECT_EQ(said({-1, 2, 1}), "joint 1" + is_cycle);
  EXPECT_EQ(said({1, 2, 3, 0}), "joint 0" + is_cycle);
}

TEST(Skeleton, RefusesNumbersThatAreNotFinite) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Matrices rest = rigs::identities(3);
    rest[2](1, 3) = bad;
    EXPECT_EQ(complaint([&] { Skeleton(rigs::chain(3), rest); }),
              "the rest transform of joint 2 holds a number that is not finite");
  }
}

TEST(Skeleton, RefusesARestTransformWithoutAnInverse) {
  Matrices rest = rigs::identities(3);
  rest[1](0, 0) = 0;
  EXPECT_EQ(complaint([&] { Skeleton(rigs::chain(3), rest); }), "the rest transform of joint 1 cannot be inverted");
}

}  // namespace
}  // namespace sinew
