#include "sinew/skin.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "rigs.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;
using Offsets = std::vector<std::int64_t>;
using Joints = std::vector<std::int32_t>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
const Floats kTwo{1, 2, 3, 4, 5, 6};  // two vertices

TEST(Skin, KeepsInfluencesInTheirOrder) {
  const Offsets offsets{0, 3, 5};
  const Joints joints{2, 0, 2, 1, 0};
  const Floats weights{0.5f, 0, 0.5f, -0.25f, 1.25f};
  const Skin skin(kTwo, offsets, joints, weights, 3);
  EXPECT_EQ(skin.vertex_count(), 2);
  EXPECT_EQ(skin.joint_count(), 3);
  EXPECT_EQ(skin.influence_count(), 5);
  EXPECT_TRUE(std::ranges::equal(skin.rest_positions(), kTwo));
  EXPECT_TRUE(std::ranges::equal(skin.offsets(), offsets));
  EXPECT_TRUE(std::ranges::equal(skin.joints(), joints));
  EXPECT_TRUE(std::ranges::equal(skin.weights(), weights));
  EXPECT_EQ(skin.most_influences(), 3);
  EXPECT_EQ(skin.unweighted_count(), 0);
  EXPECT_EQ(skin.largest_sum_error(), 0);
}

TEST(Skin, AVertexOfNothingButZerosHasNoInfluence) {
  const Floats four(12, 1.0f);
  const Skin skin(four, Offsets{0, 0, 2, 4, 5}, Joints{0, 1, 1, 0, 1}, Floats{0, -0.0f, 0, 0.75f, 0.5f}, 2);
  EXPECT_TRUE(std::ranges::equal(skin.offsets(), Offsets{0, 0, 0, 2, 3}));
  EXPECT_TRUE(std::ranges::equal(skin.joints(), Joints{1, 0, 1}));
  EXPECT_TRUE(std::ranges::equal(skin.weights(), Floats{0, 0.75f, 0.5f}));
  EXPECT_EQ(skin.unweighted_count(), 2);
  EXPECT_EQ(skin.most_influences(), 2);
  EXPECT_EQ(skin.largest_sum_error(), 0.5);
}

TEST(Skin, MayBeEmpty) {
  const Skin skin(Floats{}, Offsets{0}, Joints{}, Floats{}, 0);
  EXPECT_EQ(skin.vertex_count(), 0);
  EXPECT_EQ(skin.joint_count(), 0);
  EXPECT_EQ(skin.most_influences(), 0);
}

TEST(Skin, FromDenseLeavesOutZerosAlone) {
  // Row by row, and the same table column by column.
  const std::vector<double> rows{0.25, 0, 0.75, 0, -1e-9, 1};
  const std::vector<double> columns{0.25, 0, 0, -1e-9, 0.75, 1};
  for (const Skin& skin :
       {Skin::from_dense(kTwo, rows.data(), 2, 3, 3, 1), Skin::from_dense(kTwo, columns.data(), 2, 3, 1, 2)}) {
    EXPECT_EQ(skin.joint_count(), 3);
    EXPECT_TRUE(std::ranges::equal(skin.offsets(), Offsets{0, 2, 4}));
    EXPECT_TRUE(std::ranges::equal(skin.joints(), Joints{0, 2, 1, 2}));
    EXPECT_TRUE(std::ranges::equal(skin.weights(), Floats{0.25f, 0.75f, -1e-9f, 1}));
  }
}

TEST(Skin, RefusesWhatIsWrong) {
  const auto said = [](const Floats& positions, const Offsets& offsets, const Joints& joints, const Floats& weights,
                       std::ptrdiff_t count) {
    return complaint([&] { Skin(positions, offsets, joints, weights, count); });
  };
  const Offsets one_each{0, 1, 2};
  EXPECT_EQ(said(kTwo, one_each, {0, 1}, {1, 1}, 2), "(no complaint)");
  EXPECT_EQ(said(kTwo, one_each, {0, 1}, {1, 1}, -2), "joint_count is -2; expected 0 or more");
  EXPECT_EQ(said({1, 2, 3, 4}, {0, 1}, {0}, {1}, 2), "rest_positions has 4 numbers; expected three per vertex");
  EXPECT_EQ(said(kTwo, {0, 2}, {0, 1}, {1, 1}, 2),
            "offsets has 2 entries; expected 3, one more than there are vertices");
  EXPECT_EQ(said(kTwo, {}, {0, 1}, {1, 1}, 2), "offsets has 0 entries; expected 3, one more than there are vertices");
  EXPECT_EQ(said(kTwo, one_each, {0, 1}, {1}, 2), "joints has 2 entries and weights has 1; expected as many of each");
  EXPECT_EQ(said(kTwo, {1, 1, 2}, {0, 1}, {1, 1}, 2),
            "offsets goes from 1 to 2; expected 0 to 2, the number of influences");
  EXPECT_EQ(said(kTwo, {0, 1, 3}, {0, 1}, {1, 1}, 2),
            "offsets goes from 0 to 3; expected 0 to 2, the number of influences");
  EXPECT_EQ(said(kTwo, {0, 3, 2}, {0, 1}, {1, 1}, 2), "offsets[2] is 2, below the one before");
  EXPECT_EQ(said({1, 2, 3, 4, kNan, 6}, one_each, {0, 1}, {1, 1}, 2), "the rest position of vertex 1 is not finite");
  EXPECT_EQ(said(kTwo, one_each, {0, 2}, {1, 1}, 2), "influence 1 names joint 2; there are 2 joints");
  EXPECT_EQ(said(kTwo, one_each, {-1, 0}, {1, 1}, 2), "influence 0 names joint -1; there are 2 joints");
  EXPECT_EQ(said(kTwo, one_each, {0, 1}, {1, kNan}, 2), "the weight of influence 1 is not finite");
}

TEST(Skin, RefusesMoreThanItCanCount) {
  check_counts(kMostNumbers, kMostNumbers, kMostJoints);
  EXPECT_EQ(complaint([] { check_counts(kMostNumbers + 1, 0, 0); }),
            "there are 2,147,483,648 vertices; expected at most 2,147,483,647");
  EXPECT_EQ(complaint([] { check_counts(0, kMostNumbers + 1, 0); }),
            "there are 2,147,483,648 influences; expected at most 2,147,483,647");
  EXPECT_EQ(complaint([] { check_counts(0, 0, kMostJoints + 1); }),
            "joint_count is 16,777,217; expected at most 16,777,216");
}

TEST(Skin, FromDenseRefusesWhatIsWrong) {
  const std::vector<double> weights{1, 0, 0, kNan};
  EXPECT_EQ(complaint([&] { Skin::from_dense(kTwo, weights.data(), 1, 2, 2, 1); }),
            "weights has 1 row; there are 2 vertices");
  EXPECT_EQ(complaint([&] { Skin::from_dense(kTwo, weights.data(), 2, 2, 2, 1); }),
            "the weight in row 1, column 1 is not finite");
}

}  // namespace
}  // namespace sinew
