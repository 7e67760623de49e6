#include "base/check.h"

#include <gtest/gtest.h>

#include "failures.h"

namespace sinew {
namespace {

TEST(Check, FailWritesItsPartsInOneSentence) {
  EXPECT_EQ(complaint([] { fail("joint ", 3, " of \"", std::string("a"), "\""); }), "joint 3 of \"a\"");
}

TEST(Check, GroupedSetsCommas) {
  EXPECT_EQ(grouped(0), "0");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1,000");
  EXPECT_EQ(grouped(29960), "29,960");
  EXPECT_EQ(grouped(10000000000), "10,000,000,000");
  EXPECT_EQ(grouped(-1000), "-1,000");
  EXPECT_EQ(grouped(-100), "-100");
}

TEST(Check, PluralKnowsTheNounsOfTheMessages) {
  EXPECT_EQ(plural(1, "vertex"), "1 vertex");
  EXPECT_EQ(plural(0, "vertex"), "0 vertices");
  EXPECT_EQ(plural(2, "matrix"), "2 matrices");
  EXPECT_EQ(plural(2, "entry"), "2 entries");
  EXPECT_EQ(plural(2, "key"), "2 keys");
  EXPECT_EQ(plural(29960, "row"), "29,960 rows");
}

}  // namespace
}  // namespace sinew
