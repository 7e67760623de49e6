#include "sinew/group_influences.h"

#include <gtest/gtest.h>

#include "failures.h"

namespace sinew {
namespace {

using Offsets = std::vector<std::int64_t>;
using Numbers = std::vector<std::int32_t>;
using Floats = std::vector<float>;

TEST(GroupInfluences, AreDividedByTheSumOfThoseThatMove) {
  const Offsets offsets{0, 2, 4, 5, 6, 6, 8};
  const Numbers groups{0, 1, 2, 0, 1, 0, 0, 9};
  const Floats weights{0.25f, 0.75f, 0.5f, 0.5f, 1, 5e-5f, 0, 1};
  const auto own = group_influences(offsets, groups, weights, Numbers{7, 3, -1});
  EXPECT_EQ(own.offsets, (Offsets{0, 2, 3, 4, 4, 4, 4}));
  EXPECT_EQ(own.joints, (Numbers{7, 3, 7, 3}));
  EXPECT_EQ(own.weights, (Floats{0.25f, 0.75f, 1, 1}));
  EXPECT_EQ(own.unweighted_count, 3);
  EXPECT_EQ(own.unnormalized_count, 1);
}

TEST(GroupInfluences, RefusesSizesThatDoNotFit) {
  const auto said = [](const Offsets& offsets, const Numbers& groups, const Floats& weights) {
    return complaint([&] { group_influences(offsets, groups, weights, {}); });
  };
  EXPECT_EQ(said({0, 1}, {0}, {1, 1}), "groups has 1 entries and weights has 2; expected as many of each");
  EXPECT_EQ(said({}, {}, {}), "offsets is empty; expected one number more than there are rows");
  EXPECT_EQ(said({0, 2}, {0}, {1}), "offsets goes from 0 to 2; expected 0 to 1, the number of entries");
  EXPECT_EQ(said({0, 2, 1, 2}, {0, 0}, {1, 1}), "offsets[2] is 1, below the one before");
}

}  // namespace
}  // namespace sinew
