#include "sinew/rig_skeleton.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/utf8.h"
#include "failures.h"
#include "files.h"
#include "rigs.h"

namespace sinew {
namespace {

using Integers = std::vector<std::int32_t>;
using Names = std::vector<std::string>;

Eigen::MatrixX3d points(std::initializer_list<std::initializer_list<double>> rows) {
  return rows.size() ? Eigen::MatrixX3d(rows) : Eigen::MatrixX3d(0, 3);
}

/// A root, a hip, a knee beneath it and a second child of the root.
const char* const kBones =
    "-1 -1 0 0 1\n"
    "0 0 0 0 2\n"
    "1 1 0 3 0\n"
    "2 0 4 0 0\n";

class RigSkeletonFile : public testing::Test {
 protected:
  RigSkeleton read(const std::string& bytes, std::optional<Convention> convention = std::nullopt,
                   const std::string& name = "a.bf") {
    return read_skeleton(folder_.file(name, bytes), convention);
  }
  std::string said(const std::string& bytes, const std::string& name = "a.bf") {
    return complaint([&] { read(bytes, std::nullopt, name); });
  }
  RigSkeleton again(const RigSkeleton& skeleton, const std::string& name = "again.bf") {
    write_skeleton(folder_.path(name), skeleton);
    return read_skeleton(folder_.path(name));
  }
  std::string refused(const RigSkeleton& skeleton, const std::string& name) {
    folder_.file(name, "old");
    const std::string message = complaint([&] { write_skeleton(folder_.path(name), skeleton); });
    EXPECT_EQ(folder_.bytes(name), "old");
    return message;
  }
  TemporaryFolder folder_;
};

void expect_same(const RigSkeleton& a, const RigSkeleton& b) {
  EXPECT_TRUE(std::ranges::equal(a.parents(), b.parents()));
  EXPECT_EQ(a.weight_columns(), b.weight_columns());
  EXPECT_EQ(a.convention(), b.convention());
  ASSERT_EQ(a.joint_count(), b.joint_count());
  EXPECT_LT((a.heads() - b.heads()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((a.tails() - b.tails()).cwiseAbs().maxCoeff(), 1e-14);
}

using BoneForest = RigSkeletonFile;
using TrivialGraph = RigSkeletonFile;

TEST_F(BoneForest, BoneConventionIsKnownByItsRoot) {
  const RigSkeleton skeleton = read(kBones);
  EXPECT_EQ(skeleton.convention(), Convention::bone);
  EXPECT_TRUE(std::ranges::equal(skeleton.parents(), Integers{-1, 0, 1, 0}));
  EXPECT_EQ(skeleton.weight_columns(), (Integers{-1, 0, 1, 2}));
  // Row j turns about its parent's joint; its bone ends at its own.
  EXPECT_EQ(skeleton.heads(), points({{0, 0, 1}, {0, 0, 1}, {0, 0, 3}, {0, 0, 1}}));
  EXPECT_EQ(skeleton.tails(), points({{0, 0, 1}, {0, 0, 3}, {0, 3, 3}, {4, 0, 1}}));
  EXPECT_EQ(skeleton.names(), (Names{"joint_0", "joint_1", "joint_2", "joint_3"}));
}

TEST_F(BoneForest, JointConvention) {
  const RigSkeleton skeleton = read("0 -1 0 0 1\n1 0 0 0 2\n2 1 0 3 0\n3 0 4 0 0\n4 -1 7 7 7\n");
  EXPECT_EQ(skeleton.convention(), Convention::joint);
  EXPECT_EQ(skeleton.weight_columns(), (Integers{0, 1, 2, 3, 4}));
  EXPECT_EQ(skeleton.heads(), points({{0, 0, 1}, {0, 0, 3}, {0, 3, 3}, {4, 0, 1}, {7, 7, 7}}));
  // To the middle of the children; on past a leaf by half its length; nowhere for a lone joint.
  EXPECT_EQ(skeleton.tails(), points({{2, 0, 2}, {0, 3, 3}, {0, 4.5, 3}, {6, 0, 1}, {7, 7, 7}}));
}

TEST_F(BoneForest, RestTransformsAreTranslationsToTheHeads) {
  const RigSkeleton skeleton = read(kBones);
  for (int j = 0; j < 4; ++j) {
    const Matrix4<double> expected = rigs::turn(0, {0, 0, 1}, skeleton.heads().row(j));
    EXPECT_EQ(skeleton.rest_world()[j], expected);
  }
}

TEST_F(BoneForest, TheCallerMayOverrideTheConvention) {
  const RigSkeleton joints = read(kBones, Convention::joint);
  EXPECT_EQ(joints.convention(), Convention::joint);
  EXPECT_EQ(joints.heads(), points({{0, 0, 1}, {0, 0, 3}, {0, 3, 3}, {4, 0, 1}}));
  const RigSkeleton bones = read("0 -1 0 0 1\n1 0 0 0 2\n", Convention::bone);
  EXPECT_EQ(bones.convention(), Convention::bone);
  EXPECT_EQ(bones.heads(), points({{0, 0, 1}, {0, 0, 1}}));
}

TEST_F(BoneForest, ParentsMayComeLaterAndRootsBeSeveral) {
  const RigSkeleton skeleton = read("1 2 1 0 0\n-1 -1 0 0 9\n0 1 0 2 0\n2 -1 5 5 5\n", Convention::joint);
  EXPECT_EQ(skeleton.heads(), points({{1, 2, 9}, {0, 0, 9}, {0, 2, 9}, {5, 5, 5}}));
}

TEST_F(BoneForest, LineEndsBlankLinesAndPlusSigns) {
  const RigSkeleton skeleton = read(
      "\xEF\xBB\xBF"
      "\r\n-1 -1 +1.5 0 0\r\n\r\n \t\r\n0\t0 1e0 0 0");
  EXPECT_EQ(skeleton.tails(), points({{1.5, 0, 0}, {2.5, 0, 0}}));
}

TEST_F(BoneForest, TextAfterTheFifthFieldMayNameTheJoints) {
  EXPECT_EQ(read("0 -1 0 0 0 hip\n1 0 1 0 0  Upper Arm.L \r\n2 0 1 0 0 1_toe\n").names(),
            (Names{"hip", "Upper Arm.L", "1_toe"}));
  const Names made{"joint_0", "joint_1"};
  EXPECT_EQ(read("0 -1 0 0 0 hip\n1 0 1 0 0\n").names(), made);          // one has none
  EXPECT_EQ(read("0 -1 0 0 0 hip\n1 0 1 0 0 hip\n").names(), made);      // twice the same
  EXPECT_EQ(read("0 -1 0 0 0 0.5 x\n1 0 1 0 0 0.7 y\n").names(), made);  // numbers
  EXPECT_EQ(read("0 -1 0 0 0 # a\n1 0 1 0 0 # b\n").names(), made);      // comments
}

TEST_F(BoneForest, RoundTrips) {
  for (const char* bytes : {kBones, "0 -1 0.1 0.2 0.3 hip joint\n1 0 0.7 -0.1 1e-9 2nd\n2 -1 1 1 1 x\n",
                            "2 2 1 0 0\n0 -1 0 0 9\n1 1 0 2 0\n"}) {
    const RigSkeleton skeleton = read(bytes);
    const RigSkeleton back = again(skeleton);
    expect_same(back, skeleton);
    EXPECT_EQ(back.names(), skeleton.names());
    const std::string first = folder_.bytes("again.bf");
    again(back);
    EXPECT_EQ(folder_.bytes("again.bf"), first);
  }
}

TEST_F(BoneForest, RefusesRowsThatAreNone) {
  EXPECT_EQ(said(""), "a.bf holds no joints");
  EXPECT_EQ(said("\n \r\n"), "a.bf holds no joints");
  EXPECT_EQ(said("0 -1 0 0\n"), "a.bf, line 1: the line ends where an offset is expected");
  EXPECT_EQ(said("0 -1 0 0 0\n1\n"), "a.bf, line 2: the line ends where the parent's row is expected");
  EXPECT_EQ(said("x -1 0 0 0\n"), "a.bf, line 1: expected a weight index, found \"x\"");
  EXPECT_EQ(said("\n0 -1 0 nan 0\n"), "a.bf, line 2: expected an offset, found \"nan\"");
  EXPECT_EQ(said("0 -1.5 0 0 0\n"), "a.bf, line 1: expected the parent's row, found \"-1.5\"");
  EXPECT_EQ(said("-2 -1 0 0 0\n"), "a.bf, line 1: expected a weight index of -1 (none) or more");
}

TEST_F(BoneForest, RefusesTreesThatAreNone) {
  EXPECT_EQ(said("0 -1 0 0 0\n1 2 0 0 0\n"), "a.bf: joint 1 has parent 2; expected -1 (a root) to 1");
  EXPECT_EQ(said("0 -2 0 0 0\n"), "a.bf: joint 0 has parent -2; expected -1 (a root) to 0");
  EXPECT_EQ(said("0 -1 0 0 0\n1 2 0 0 0\n2 1 0 0 0\n"),
            "a.bf: joint 1 is its own ancestor: its chain of parents is a cycle");
  EXPECT_EQ(said("0 -1 0 0 0\n0 0 0 0 0\n"), "a.bf: two joints have weight column 0, the second is joint 1");
}

TEST_F(BoneForest, RefusesToWriteWhatItWouldReadDifferently) {
  const auto heads = points({{0, 0, 0}, {1, 0, 0}}), tails = points({{1, 0, 0}, {2, 0, 0}});
  EXPECT_EQ(refused(RigSkeleton(Integers{-1, 0}, heads, tails, {-1, 0}, {}, Convention::joint), "a.bf"),
            "a.bf cannot hold this skeleton: a .bf file is read in the bone convention if a root is "
            "without a column of weights");
  EXPECT_EQ(refused(RigSkeleton(Integers{-1, 0}, heads, heads, {0, 1}, {}, Convention::bone), "a.bf"),
            "a.bf cannot hold joint joint_1 in the bone convention: it does not start where its "
            "parent's bone ends");
  EXPECT_EQ(
      refused(RigSkeleton(Integers{-1}, points({{0, 0, 0}}), points({{0, 0, 0}}), {0}, {}, Convention::bone), "a.bf"),
      "a.bf cannot hold this skeleton: a .bf file is read in the joint convention unless a root "
      "is without a column of weights");
  EXPECT_EQ(refused(RigSkeleton(Integers{-1, 0}, heads, tails, {-1, 0}, {}, Convention::bone), "a.bf"),
            "a.bf cannot hold the root bone joint_0: a .bf file has a row for the joint that it starts "
            "from; write a .tgf file");
  for (const std::string name : {"12", "# hip", " hip", "hip\nx", "-1.5 hip"}) {
    EXPECT_EQ(
        refused(RigSkeleton(Integers{-1}, points({{0, 0, 0}}), points({{0, 0, 0}}), {0}, {name}, Convention::joint),
                "a.bf"),
        "a.bf cannot hold the name \"" + printable(name) +
            "\" of joint 0: it reads as a number, a comment "
            "or nothing; rename it");
  }
}

/// Five joints; two bones from joint 1, one on from joint 2, one apart.
const std::string kJointLines = "1 0 0 0\n2 1 0 0\n3 2 0 0\n4 0 5 0\n5 9 9 9\n";

TEST_F(TrivialGraph, EdgesAreBones) {
  const RigSkeleton skeleton = read(kJointLines + "#\n2 3\n1 2\n1 4\n4 5\n", std::nullopt, "a.tgf");
  EXPECT_EQ(skeleton.convention(), Convention::bone);
  EXPECT_TRUE(std::ranges::equal(skeleton.parents(), Integers{1, -1, -1, 2}));
  EXPECT_EQ(skeleton.weight_columns(), (Integers{0, 1, 2, 3}));
  EXPECT_EQ(skeleton.heads(), points({{1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 5, 0}}));
  EXPECT_EQ(skeleton.tails(), points({{2, 0, 0}, {1, 0, 0}, {0, 5, 0}, {9, 9, 9}}));
}

TEST_F(TrivialGraph, FlagsFurtherNumbersAndFurtherSectionsAreSkipped) {
  const RigSkeleton plain = read(kJointLines + "#\n1 2\n2 3\n", std::nullopt, "a.tgf");
  const RigSkeleton full = read(
      "\xEF\xBB\xBF"
      "1 0 0 0 0.5\r\n2 1 0 0 7 x\r\n\r\n3 2 0 0\r\n4 0 5 0\r\n5 9 9 9\r\n"
      "# edges\r\n1 2 1 0 0\r\n\r\n2 3 1 0 0\r\n#\r\n4 5 0 1 0\r\n#\r\nanything\r\n#",
      std::nullopt, "a.TGF");
  expect_same(full, plain);
}

TEST_F(TrivialGraph, RoundTrips) {
  const RigSkeleton skeleton = read(kJointLines + "#\n2 3\n1 2\n1 4\n4 5\n", Convention::bone, "a.tgf");
  const RigSkeleton back = again(skeleton, "again.tgf");
  expect_same(back, skeleton);
  EXPECT_EQ(back.heads(), skeleton.heads());
  EXPECT_EQ(back.tails(), skeleton.tails());
}

TEST_F(TrivialGraph, RefusesGraphsThatAreNone) {
  EXPECT_EQ(said("", "a.tgf"), "a.tgf holds no bones");
  EXPECT_EQ(said(kJointLines, "a.tgf"), "a.tgf holds no bones");
  EXPECT_EQ(said("1 0 0 0\n3 0 0 0\n", "a.tgf"), "a.tgf, line 2: joint 3 found; expected joint 2");
  EXPECT_EQ(said("1 0 0\n", "a.tgf"), "a.tgf, line 1: the line ends where a coordinate is expected");
  EXPECT_EQ(said("a 0 0 0\n", "a.tgf"), "a.tgf, line 1: expected a joint's number, found \"a\"");
  EXPECT_EQ(said("1 0 inf 0\n", "a.tgf"), "a.tgf, line 1: expected a coordinate, found \"inf\"");
  EXPECT_EQ(said(kJointLines + "#\n1 6\n", "a.tgf"), "a.tgf, line 7: joint 6 does not exist; there are 5");
  EXPECT_EQ(said(kJointLines + "#\n0 1\n", "a.tgf"), "a.tgf, line 7: joint 0 does not exist; there are 5");
  EXPECT_EQ(said(kJointLines + "#\n1\n", "a.tgf"), "a.tgf, line 7: the line ends where a joint's number is expected");
  EXPECT_EQ(said(kJointLines + "#\n1 2\n3 2\n", "a.tgf"),
            "a.tgf, line 8: a second bone ends at joint 2; expected a tree");
  EXPECT_EQ(said(kJointLines + "#\n1 2\n2 1\n", "a.tgf"),
            "a.tgf: joint 0 is its own ancestor: its chain of parents is a cycle");
  EXPECT_EQ(said(kJointLines + "#\n1 1\n", "a.tgf"),
            "a.tgf: joint 0 is its own ancestor: its chain of parents is a cycle");
}

TEST_F(TrivialGraph, RefusesTheJointConvention) {
  EXPECT_EQ(complaint([&] { read(kJointLines + "#\n1 2\n", Convention::joint, "a.tgf"); }),
            "a.tgf is in the bone convention, like every .tgf file; the joint convention was requested");
}

TEST_F(TrivialGraph, RefusesToWriteWhatItCannotHold) {
  const auto heads = points({{0, 0, 0}, {1, 0, 0}}), tails = points({{1, 0, 0}, {2, 0, 0}});
  const Integers parents{-1, 0};
  EXPECT_EQ(refused(RigSkeleton(parents, heads, tails, {0, 1}, {}, Convention::joint), "a.tgf"),
            "a.tgf cannot hold a skeleton in the joint convention; write a .bf file");
  EXPECT_EQ(refused(RigSkeleton(parents, heads, tails, {1, 0}, {}, Convention::bone), "a.tgf"),
            "a.tgf cannot hold joint joint_0: its bones are the columns of weights, in order; write a "
            ".bf file");
  EXPECT_EQ(refused(RigSkeleton(parents, heads, heads, {0, 1}, {"a", "b"}, Convention::bone), "a.tgf"),
            "a.tgf cannot hold joint b in the bone convention: it does not start where its parent's "
            "bone ends");
}

TEST_F(RigSkeletonFile, RefusesUnknownEndings) {
  const std::string expected = "a.txt is not a skeleton file; expected a name that ends in .bf or .tgf";
  EXPECT_EQ(said(kBones, "a.txt"), expected);
  EXPECT_EQ(complaint([&] { write_skeleton(folder_.path("a.txt"), read(kBones)); }), expected);
  EXPECT_EQ(complaint([&] { read_skeleton(folder_.path("none.bf")); }),
            "there is no file " + folder_.path("none.bf").string());
}

TEST(RigSkeleton, KeepsWhatItIsGiven) {
  const auto heads = points({{1, 2, 3}, {4, 5, 6}}), tails = points({{7, 8, 9}, {0, 1, 2}});
  const RigSkeleton skeleton(Integers{1, -1}, heads, tails, {3, -1}, {"b", "a"}, Convention::joint);
  EXPECT_EQ(skeleton.heads(), heads);
  EXPECT_EQ(skeleton.tails(), tails);
  EXPECT_EQ(skeleton.weight_columns(), (Integers{3, -1}));
  EXPECT_EQ(skeleton.names(), (Names{"b", "a"}));
  EXPECT_EQ(skeleton.rest<double>()[0], rigs::turn(0, {0, 0, 1}, {-3, -3, -3}));
}

TEST(RigSkeleton, RefusesWhatIsWrong) {
  const auto two = points({{1, 2, 3}, {4, 5, 6}}), one = points({{1, 2, 3}});
  const auto said = [](const Integers& parents, const Eigen::MatrixX3d& heads, const Eigen::MatrixX3d& tails,
                       const Integers& columns) {
    return complaint([&] { RigSkeleton(parents, heads, tails, columns, {}, Convention::joint); });
  };
  const Integers chain{-1, 0}, columns{0, 1};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(said(chain, one, two, columns), "there are 1 head; the skeleton has 2 joints");
  EXPECT_EQ(said(chain, two, one, columns), "there are 1 tail and 2 weight columns; the skeleton has 2 joints");
  EXPECT_EQ(said(chain, two, two, {0}), "there are 2 tails and 1 weight column; the skeleton has 2 joints");
  EXPECT_EQ(said(chain, two, points({{1, 2, 3}, {nan, 5, 6}}), columns), "a tail holds a number that is not finite");
  EXPECT_EQ(said(chain, points({{1, 2, 3}, {nan, 5, 6}}), two, columns),
            "the rest transform of joint 1 holds a number that is not finite");
  EXPECT_EQ(said(chain, two, two, {0, -2}), "joint 1 has weight column -2; expected -1 or more");
  EXPECT_EQ(said(chain, two, two, {4, 4}), "two joints have weight column 4, the second is joint 1");
  EXPECT_EQ(said({-1, 7}, two, two, columns), "joint 1 has parent 7; expected -1 (a root) to 1");
}

}  // namespace
}  // namespace sinew
