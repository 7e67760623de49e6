#include "sinew/rig.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "files.h"
#include "rigs.h"
#include "sinew/dmat.h"

namespace sinew {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

/// A folder with a triangle on two bones, to be broken in one place by each test.
class RigFolder : public testing::Test {
 protected:
  RigFolder() {
    folder_.file("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder_.file("skeleton.bf", "-1 -1 0 0 0\n0 0 1 0 0\n1 1 1 0 0\n");
    folder_.file("weights.dmat", "2 3\n1 0.5 0\n0 0.5 1\n");
  }
  Rig read() { return read_rig(find_rig(folder_.path())); }
  std::string said() {
    return complaint([&] { read(); });
  }
  /// 2 frames of 2 bones: the matrix of bone b in frame f holds 100 f + 50 b + 1, 2, ... 12.
  void write_animation() {
    Eigen::MatrixXd table(24, 2);
    for (int frame = 0; frame < 2; ++frame) {
      for (int bone = 0; bone < 2; ++bone) {
        for (int row = 0; row < 3; ++row) {
          for (int column = 0; column < 4; ++column) {
            table(8 * row + 4 * bone + column, frame) = 100 * frame + 50 * bone + 4 * row + column + 1;
          }
        }
      }
    }
    write_dmat(folder_.path("anim.dmat"), table, true);
  }
  TemporaryFolder folder_;
};

TEST_F(RigFolder, ReadsItsParts) {
  folder_.file("pose.dmat", "1 9\n0 0 0 0 0 90 0 0 0\n");
  const Rig rig = read();
  EXPECT_EQ(rig.mesh.vertex_count(), 3);
  EXPECT_EQ(rig.skeleton.joint_count(), 3);
  EXPECT_EQ(rig.weights, (Eigen::MatrixXd{{1, 0}, {0.5, 0.5}, {0, 1}}));
  ASSERT_TRUE(rig.poses);
  EXPECT_EQ(rig.poses->pose_count(), 1);
  EXPECT_FALSE(rig.animation);
}

TEST_F(RigFolder, WeightsOutOfRangeAreCountedAndBroughtIntoIt) {
  folder_.file("weights.dmat", "2 3\n1.5 -0.25 -1\n-0.5 0.5 -2\n");
  Rig rig = read();
  EXPECT_EQ(rig.weights, (Eigen::MatrixXd{{1, 0}, {0, 1}, {0, 0}}));
  EXPECT_EQ(rig.clamped_weights, 5);
  folder_.file("weights.dmat", "2 3\n3 0.25 0.5\n0.25 0.5 0.125\n");
  rig = read();
  EXPECT_EQ(rig.weights, (Eigen::MatrixXd{{0.8, 0.2}, {0.25, 0.5}, {0.5, 0.125}}));
  EXPECT_EQ(rig.clamped_weights, 1);
}

TEST_F(RigFolder, WeightsThatAreOffByARoundingAreNotCounted) {
  folder_.file("weights.dmat", "2 3\n1.00000001 0.5 0\n-9e-10 0.5 1\n");
  const Rig rig = read();
  EXPECT_EQ(rig.weights, (Eigen::MatrixXd{{1, 0}, {0.5, 0.5}, {0, 1}}));
  EXPECT_EQ(rig.clamped_weights, 0);
}

TEST_F(RigFolder, PosesMayBeQuaternionsInEitherOrder) {
  folder_.file("pose.dmat", "1 12\n1 0 0 0\n0.6 0.8 0 0\n0 0 0 1\n");
  EXPECT_EQ(read().poses->rotations()[1].w(), 0.6);
  const Rig other = read_rig(find_rig(folder_.path()), std::nullopt, QuaternionOrder::xyzw);
  EXPECT_EQ(other.poses->rotations()[1].y(), 0.8);
}

TEST_F(RigFolder, FindsTheUsualNames) {
  RigPaths paths = find_rig(folder_.path());
  EXPECT_EQ(paths.mesh, folder_.path("mesh.obj"));
  EXPECT_EQ(paths.skeleton, folder_.path("skeleton.bf"));
  EXPECT_EQ(paths.weights, folder_.path("weights.dmat"));
  EXPECT_TRUE(paths.poses.empty());
  EXPECT_TRUE(paths.animation.empty());
  std::filesystem::rename(folder_.path("skeleton.bf"), folder_.path("skeleton.tgf"));
  folder_.file("pose.dmat", "");
  folder_.file("anim.dmat", "");
  paths = find_rig(folder_.path());
  EXPECT_EQ(paths.skeleton, folder_.path("skeleton.tgf"));
  EXPECT_EQ(paths.poses, folder_.path("pose.dmat"));
  EXPECT_EQ(paths.animation, folder_.path("anim.dmat"));
}

TEST_F(RigFolder, AnimationIsOneMatrixAJoint) {
  write_animation();
  const Rig rig = read();
  ASSERT_TRUE(rig.animation);
  EXPECT_EQ(rig.animation->frames, 2);
  ASSERT_EQ(rig.animation->matrices.size(), 6u);
  EXPECT_EQ(rig.animation->matrices[3], Matrix4<double>::Identity());  // the root has no column
  const Matrix4<double> expected{{151, 152, 153, 154}, {155, 156, 157, 158}, {159, 160, 161, 162}, {0, 0, 0, 1}};
  EXPECT_EQ(rig.animation->matrices[5], expected);
}

TEST_F(RigFolder, AnimationOfAJointWithoutColumnIsItsParents) {
  folder_.file("skeleton.bf", "-1 -1 0 0 0\n0 0 1 0 0\n-1 1 1 0 0\n1 2 1 0 0\n");
  write_animation();
  const auto animation = *read().animation;
  EXPECT_EQ(animation.matrices[2], animation.matrices[1]);
}

TEST_F(RigFolder, RoundTripsBitForBit) {
  folder_.file("pose.dmat", "2 12\n1 0 0 0 0.6 0.8 0 0 0 0 0 1 1 0 0 0 0 1 0 0 1 0 0 0\n");
  write_animation();
  const Rig rig = read();
  const TemporaryFolder other;
  const RigPaths paths{other.path("mesh.obj"), other.path("skeleton.bf"), other.path("weights.dmat"),
                       other.path("pose.dmat"), other.path("anim.dmat")};
  write_rig(paths, rig);
  const Rig back = read_rig(find_rig(other.path()));
  EXPECT_EQ(back.mesh.positions, rig.mesh.positions);
  EXPECT_EQ(back.mesh.face_vertices, rig.mesh.face_vertices);
  EXPECT_EQ(back.skeleton.tails(), rig.skeleton.tails());
  EXPECT_EQ(back.weights, rig.weights);
  EXPECT_EQ(back.poses->to_table(), rig.poses->to_table());
  EXPECT_EQ(back.animation->matrices, rig.animation->matrices);
  EXPECT_EQ(other.bytes("anim.dmat"), folder_.bytes("anim.dmat"));
}

TEST_F(RigFolder, WritesNoPosesThatItDoesNotHave) {
  const TemporaryFolder other;
  write_rig({other.path("mesh.obj"), other.path("skeleton.bf"), other.path("weights.dmat"), other.path("pose.dmat"),
             other.path("anim.dmat")},
            read());
  EXPECT_FALSE(std::filesystem::exists(other.path("pose.dmat")));
  EXPECT_FALSE(std::filesystem::exists(other.path("anim.dmat")));
}

TEST_F(RigFolder, ASkeletonThatCannotBeWrittenLeavesEverything) {
  const RigPaths paths = find_rig(folder_.path());
  Rig rig = read();
  rig.skeleton = RigSkeleton(rig.skeleton.parents(), rig.skeleton.heads(), rig.skeleton.tails(),
                             rig.skeleton.weight_columns(), {}, Convention::joint);
  rig.mesh.positions[0] = 5;
  const std::string mesh = folder_.bytes("mesh.obj"), skeleton = folder_.bytes("skeleton.bf");
  EXPECT_NE(complaint([&] { write_rig(paths, rig); }), "(no complaint)");
  EXPECT_EQ(folder_.bytes("mesh.obj"), mesh);
  EXPECT_EQ(folder_.bytes("skeleton.bf"), skeleton);
}

TEST_F(RigFolder, RefusesFoldersThatAreNone) {
  EXPECT_EQ(complaint([&] { find_rig(folder_.path("none")); }), "there is no folder " + folder_.path("none").string());
  EXPECT_EQ(complaint([&] { find_rig(folder_.path("mesh.obj")); }),
            "there is no folder " + folder_.path("mesh.obj").string());
}

TEST_F(RigFolder, RefusesMissingParts) {
  std::filesystem::remove(folder_.path("weights.dmat"));
  EXPECT_EQ(said(), "there is no file " + folder_.path("weights.dmat").string());
  std::filesystem::remove(folder_.path("mesh.obj"));
  EXPECT_EQ(said(), "there is no file " + folder_.path("mesh.obj").string());
  std::filesystem::remove(folder_.path("skeleton.bf"));
  EXPECT_EQ(said(), "there is neither skeleton.bf nor skeleton.tgf in " + folder_.path(".").parent_path().string());
}

TEST_F(RigFolder, RefusesWeightsThatDoNotFitTheMesh) {
  folder_.file("weights.dmat", "2 4\n1 1 1 1 0 0 0 0\n");
  EXPECT_EQ(said(), "weights.dmat has 4 rows, mesh.obj has 3 vertices");
}

TEST_F(RigFolder, RefusesWeightsThatDoNotFitTheSkeleton) {
  folder_.file("weights.dmat", "3 3\n1 1 1 0 0 0 0 0 0\n");
  EXPECT_EQ(said(), "weights.dmat has 3 columns, but no joint of skeleton.bf has weight column 2");
  folder_.file("weights.dmat", "1 3\n1 1 1\n");
  EXPECT_EQ(said(), "skeleton.bf: joint 2 has weight column 1, weights.dmat has 1 column");
}

TEST_F(RigFolder, RefusesWeightsWithoutColumns) {
  // However many frames an animation of no bones promises: nobody asks for their memory.
  folder_.file("skeleton.bf", "-1 -1 0 0 0\n-1 0 1 0 0\n");
  folder_.file("weights.dmat", "0 3\n");
  folder_.file("anim.dmat", "20000000 0\n");
  EXPECT_EQ(said(), "weights.dmat has no columns; expected one per bone");
}

TEST_F(RigFolder, RefusesWeightsWithoutRowsAtOnce) {
  folder_.file("weights.dmat", "2147483647 0\n");
  EXPECT_EQ(said(), "weights.dmat has 0 rows, mesh.obj has 3 vertices");
}

TEST_F(RigFolder, RefusesColumnsBeyondTheAnimation) {
  // Twelve numbers for each of two bones, one of which claims to be number 5.
  write_animation();
  folder_.file("skeleton.bf", "-1 -1 0 0 0\n0 0 1 0 0\n5 1 1 0 0\n");
  EXPECT_EQ(said(), "skeleton.bf: joint 2 has weight column 5, weights.dmat has 2 columns");
}

TEST_F(RigFolder, RefusesPosesThatDoNotFit) {
  folder_.file("pose.dmat", "1 5\n1 2 3 4 5\n");
  EXPECT_EQ(said(),
            "pose.dmat: there are 5 numbers per pose; expected 9 (Euler angles) or 12 (quaternions) for "
            "3 joints");
}

TEST_F(RigFolder, RefusesAnimationThatDoesNotFit) {
  folder_.file("anim.dmat", "1 5\n1 2 3 4 5\n");
  EXPECT_EQ(said(), "anim.dmat has 5 rows; expected 24, 12 for each of 2 bones");
}

/// What check_rig says of a rig that was right until `spoil`.
class RigCheck : public RigFolder {
 protected:
  template <class Spoil>
  std::string said_of(const Spoil& spoil) {
    Rig rig = read();
    rig.poses = PoseClip(3, std::vector<Eigen::Quaterniond>(3, Eigen::Quaterniond::Identity()));
    rig.animation = MatrixClip{1, rigs::identities(3)};
    spoil(rig);
    return complaint([&] { check_rig(rig); });
  }
};

TEST_F(RigCheck, TakesWhatIsRight) {
  EXPECT_EQ(said_of([](Rig&) {}), "(no complaint)");
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.face_materials.clear(); }), "(no complaint)");
}

TEST_F(RigCheck, Faces) {
  const auto said_of_offsets = [&](const std::vector<std::int32_t>& wrong) {
    return said_of([&](Rig& rig) { rig.mesh.face_offsets = wrong; });
  };
  EXPECT_EQ(said_of_offsets({}), "mesh.obj: face_offsets is empty; expected one number more than there are faces");
  EXPECT_EQ(said_of_offsets({1, 3}), "mesh.obj: face_offsets goes from 1 to 3; expected 0 to 3, the number of corners");
  EXPECT_EQ(said_of_offsets({0, 2}), "mesh.obj: face_offsets goes from 0 to 2; expected 0 to 3, the number of corners");
  EXPECT_EQ(said_of_offsets({0, 4, 3}), "mesh.obj: face_offsets[2] is 3, below the one before");
  EXPECT_EQ(said_of_offsets({0}), "mesh.obj: face_offsets goes from 0 to 0; expected 0 to 3, the number of corners");
  EXPECT_EQ(said_of_offsets({0, 2, 3}), "mesh.obj: face 0 has 2 corners; expected three at least");
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.face_vertices[1] = 3; }),
            "mesh.obj: face_vertices names vertex 3; the mesh has 3 vertices");
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.face_vertices[1] = -1; }),
            "mesh.obj: face_vertices names vertex -1; the mesh has 3 vertices");
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.face_materials = {-1, -1}; }), "mesh.obj has 1 face and 2 face materials");
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.face_materials = {0}; }),
            "mesh.obj: a face has material 0; there are 0 materials");
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.face_materials = {-2}; }),
            "mesh.obj: a face has material -2; there are 0 materials");
}

TEST_F(RigCheck, Numbers) {
  EXPECT_EQ(said_of([](Rig& rig) { rig.mesh.positions[4] = static_cast<float>(kNotANumber); }),
            "mesh.obj: a position is not finite");
  EXPECT_EQ(said_of([](Rig& rig) { rig.weights(1, 1) = kNotANumber; }), "weights.dmat: a weight is not finite");
  EXPECT_EQ(said_of([](Rig& rig) { rig.animation->matrices[2](0, 0) = kNotANumber; }),
            "anim.dmat: a matrix is not finite");
}

TEST_F(RigCheck, Weights) {
  EXPECT_EQ(said_of([](Rig& rig) { rig.weights = Eigen::MatrixXd::Ones(2, 2); }),
            "weights.dmat has 2 rows, mesh.obj has 3 vertices");
  EXPECT_EQ(said_of([](Rig& rig) { rig.weights = Eigen::MatrixXd::Ones(3, 1); }),
            "the skeleton: joint 2 has weight column 1, weights.dmat has 1 column");
  EXPECT_EQ(said_of([](Rig& rig) { rig.weights = Eigen::MatrixXd::Ones(3, 3); }),
            "weights.dmat has 3 columns, but no joint of the skeleton has weight column 2");
}

TEST_F(RigCheck, PosesAndAnimation) {
  EXPECT_EQ(said_of([](Rig& rig) { rig.poses = PoseClip(1, {Eigen::Quaterniond::Identity()}); }),
            "pose.dmat has poses of 1 joint; the skeleton has 3");
  EXPECT_EQ(said_of([](Rig& rig) { rig.animation->frames = 2; }), "anim.dmat has 3 matrices for 2 frames of 3 joints");
}

}  // namespace
}  // namespace sinew
