#include "sinew/bvh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>

#include "failures.h"
#include "files.h"

namespace sinew {
namespace {

const char* const kTwoJoints =
    "HIERARCHY\n"
    "ROOT hips of it\n"
    "{\n"
    "\tOFFSET 1 2 3\n"
    "\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    "\tJOINT knee {\n"
    "\t\tOFFSET 0 -5 0\n"
    "\t\tCHANNELS 3 Zrotation Xrotation Yrotation\n"
    "\t\tEnd Site\n"
    "\t\t{\n"
    "\t\t\tOFFSET 0 -4 0.5\n"
    "\t\t}\n"
    "\t}\n"
    "}\n"
    "MOTION\n"
    "Frames: 2\n"
    "Frame Time: 0.04\n"
    "1 2 3 0 0 0 0 0 0\n"
    "1 2 4 90 0 0 10 20 30\n";

class BvhFile : public testing::Test {
 protected:
  BvhClip read(const std::string& text) { return read_bvh(folder_.file("a.bvh", text)); }
  std::string said(const std::string& text) {
    return complaint([&] { read(text); });
  }
  /// Of the text with its first `old` replaced.
  std::string said_of(const std::string& old, const std::string& replacement) {
    std::string text = kTwoJoints;
    return said(text.replace(text.find(old), old.size(), replacement));
  }
  BvhClip again(const BvhClip& clip) {
    write_bvh(folder_.path("again.bvh"), clip);
    return read_bvh(folder_.path("again.bvh"));
  }
  TemporaryFolder folder_;
};

TEST_F(BvhFile, ReadsJointsAndFrames) {
  const BvhClip clip = read(kTwoJoints);
  EXPECT_EQ(clip.names(), (std::vector<std::string>{"hips of it", "knee"}));
  EXPECT_TRUE(std::ranges::equal(clip.skeleton().parents(), std::vector<std::int32_t>{-1, 0}));
  EXPECT_EQ(clip.offsets()[1], Eigen::Vector3d(0, -5, 0));
  EXPECT_EQ(clip.ends()[1], Eigen::Vector3d(0, -4, 0.5));
  EXPECT_EQ(clip.frame_count(), 2);
  EXPECT_EQ(clip.frame_time(), 0.04);
  EXPECT_EQ(clip.locations()[0], Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(clip.locations()[2], Eigen::Vector3d(0, 0, 1));
  EXPECT_TRUE(clip.rotations()[1].isApprox(Eigen::Quaterniond::Identity(), 1e-15));
}

TEST_F(BvhFile, TurnsInTheOrderOfTheChannels) {
  const BvhClip clip = read(kTwoJoints);
  const auto about = [](double degrees, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis);
  };
  const Eigen::Matrix3d wanted =
      (about(10, Eigen::Vector3d::UnitZ()) * about(20, Eigen::Vector3d::UnitX()) * about(30, Eigen::Vector3d::UnitY()))
          .toRotationMatrix();
  EXPECT_TRUE(clip.rotations()[3].toRotationMatrix().isApprox(wanted, 1e-14));
  EXPECT_TRUE((clip.rotations()[2] * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY(), 1e-14));
}

TEST_F(BvhFile, DoesNotDependOnLinesAndCase) {
  std::string text = kTwoJoints;
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  EXPECT_EQ(read(text).locations(), read(kTwoJoints).locations());
  std::string one_line = kTwoJoints;
  std::replace(one_line.begin() + static_cast<std::ptrdiff_t>(one_line.find("MOTION")), one_line.end(), '\n', ' ');
  EXPECT_EQ(read(one_line).locations(), read(kTwoJoints).locations());
}

TEST_F(BvhFile, WrittenItReadsBackAsTheSameMotion) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> number(-3, 3);
  const std::vector<std::int32_t> parents{2, 0, -1, 2, 0, -1};  // parents come later, and children are not together
  std::vector<Eigen::Vector3d> offsets, ends, locations;
  std::vector<Eigen::Quaterniond> rotations;
  const auto point = [&] { return Eigen::Vector3d(number(random), number(random), number(random)); };
  for (int j = 0; j < 6; ++j) {
    offsets.push_back(point());
    ends.push_back(point());
  }
  for (int i = 0; i < 6 * 40; ++i) {
    locations.push_back(i % 6 == 3 || parents[i % 6] < 0 ? point() : Eigen::Vector3d::Zero());
    rotations.emplace_back(number(random), number(random), number(random), number(random));
  }
  for (int i = 0; i < 12; ++i) {  // the middle angle is a right one
    const double sign = i % 2 ? 1 : -1;
    rotations[i] = Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(sign * std::numbers::pi / 2, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX());
  }
  const BvhClip clip(parents, offsets, ends, {"c", "d", "a", "b", "e", "f"}, 1 / 30.0, locations, rotations);
  const BvhClip found = again(clip);
  EXPECT_EQ(found.names(), (std::vector<std::string>{"a", "c", "d", "e", "b", "f"}));
  EXPECT_TRUE(std::ranges::equal(found.skeleton().parents(), std::vector<std::int32_t>{-1, 0, 1, 1, 0, -1}));
  EXPECT_EQ(found.frame_time(), clip.frame_time());
  ASSERT_EQ(found.frame_count(), 40);
  const std::vector<std::size_t> place{2, 0, 1, 4, 3, 5};  // of each joint that was read
  for (std::size_t i = 0; i < 6 * 40; ++i) {
    const std::size_t own = i / 6 * 6 + place[i % 6];
    EXPECT_EQ(found.offsets()[i % 6], clip.offsets()[place[i % 6]]);
    EXPECT_LT((found.locations()[i] - clip.locations()[own]).norm(), 1e-14);
    EXPECT_LT(found.rotations()[i].angularDistance(clip.rotations()[own]), 1e-13) << i;
  }
  EXPECT_EQ(found.ends()[2], clip.ends()[1]);
  EXPECT_NE(folder_.bytes("again.bvh").find("JOINT b\n{\nOFFSET "), std::string::npos);
}

TEST_F(BvhFile, AnglesGoOnFromFrameToFrame) {
  std::vector<Eigen::Quaterniond> rotations;
  for (int frame = 0; frame < 100; ++frame) {
    rotations.emplace_back(Eigen::AngleAxisd(0.3 * frame, Eigen::Vector3d::UnitY()));
  }
  const std::vector<Eigen::Vector3d> one(1, Eigen::Vector3d::Zero()), still(100, Eigen::Vector3d::Zero());
  write_bvh(folder_.path("a.bvh"), BvhClip(std::vector<std::int32_t>{-1}, one, one, {"a"}, 1, still, rotations));
  const std::string text = folder_.bytes("a.bvh");
  std::istringstream numbers(text.substr(text.find("Time: 1\n") + 8));
  double before = 0;
  for (int frame = 0; frame < 100; ++frame) {
    double place[3], z, y, x;
    numbers >> place[0] >> place[1] >> place[2] >> z >> y >> x;
    EXPECT_LT(std::abs(y - before), 20) << frame;
    EXPECT_LT(std::abs(z) + std::abs(x), 1e-9) << frame;
    before = y;
  }
  EXPECT_NEAR(before, 0.3 * 99 * 180 / std::numbers::pi, 1e-9);
}

TEST_F(BvhFile, SaysWhatIsWrongAndWhere) {
  EXPECT_EQ(said(""), "a.bvh ends where HIERARCHY is expected");
  EXPECT_EQ(said("HIERARCHY\nMOTION\n"), "a.bvh, line 2: expected ROOT, found \"MOTION\"");
  EXPECT_EQ(said("HIERARCHY\nROOT\n"), "a.bvh, line 2: expected the name of a joint");
  EXPECT_EQ(said_of("CHANNELS 3 ", "CHANNELS 9 "), "a.bvh, line 8: expected 0 to 6 channels, found 9");
  EXPECT_EQ(said_of("3 Zrotation", "3 Xrotation"), "a.bvh, line 8: the joint already has the channel \"Xrotation\"");
  EXPECT_EQ(said_of("3 Zrotation", "3 Wrotation"),
            "a.bvh, line 8: expected a channel such as Xposition or Zrotation, found \"Wrotation\"");
  EXPECT_EQ(said_of("OFFSET 0 -5 0", "OFFSET 0 -5"), "a.bvh, line 8: expected a coordinate, found \"CHANNELS\"");
  EXPECT_EQ(said_of("End Site", "Ends"), "a.bvh, line 9: expected JOINT, End Site or }, found \"Ends\"");
  EXPECT_EQ(said_of("MOTION", "JOINT"), "a.bvh, line 15: expected ROOT or MOTION, found \"JOINT\"");
  EXPECT_EQ(said_of("Frames: 2", "Frames: 0"), "a.bvh, line 16: expected at least 1 frame, found 0");
  EXPECT_EQ(said_of("Frames: 2", "Frames: 3"), "a.bvh ends where a number of each channel on each frame is expected");
  EXPECT_EQ(said_of("Frames: 2", "Frames: 1"),
            "a.bvh, line 19: expected the end of the file after the last frame, found \"1\"");
  EXPECT_EQ(said_of("Frames: 2", "Frames: 1000000"), "a.bvh describes 1,000,000 frames of 2 joints, more than its " +
                                                         std::to_string(std::string(kTwoJoints).size() + 6) +
                                                         " bytes can hold");
  EXPECT_EQ(said_of("0.04", "0"), "a.bvh, line 17: expected a frame time above 0, found 0");
  EXPECT_EQ(said_of("1 2 4 90", "1 2 nan 90"),
            "a.bvh, line 19: expected a number of each channel on each frame, found \"nan\"");
}

TEST(BvhClip, RefusesWhatDoesNotFit) {
  using HeadsOfJoints = std::vector<Eigen::Vector3d>;
  const HeadsOfJoints one(1, Eigen::Vector3d::Zero()), two(2, Eigen::Vector3d::Zero());
  const std::vector<Eigen::Quaterniond> turn(1, Eigen::Quaterniond::Identity());
  const auto refusal = [&](const HeadsOfJoints& ends, double time, const HeadsOfJoints& locations,
                           const std::vector<Eigen::Quaterniond>& rotations) {
    return complaint([&] { BvhClip(std::vector<std::int32_t>{-1}, one, ends, {"a"}, time, locations, rotations); });
  };
  EXPECT_EQ(refusal(one, 1, one, turn), "(no complaint)");
  EXPECT_EQ(refusal(two, 1, one, turn), "there are 2 ends and 1 name; the skeleton has 1 joint");
  EXPECT_EQ(refusal(one, 0, one, turn), "the frame time is 0; expected seconds above 0");
  EXPECT_EQ(refusal(one, 1, two, turn),
            "there are 2 locations and 1 rotation for 1 joint; expected one per joint for each of at least one frame");
  EXPECT_EQ(refusal(one, 1, {}, {}),
            "there are 0 locations and 0 rotations for 1 joint; expected one per joint for each of at least one frame");
  EXPECT_EQ(refusal(one, 1, one, {Eigen::Quaterniond(0, 0, 0, 0)}),
            "the quaternion of joint 0 in frame 0 has length 0; expected 1");
  const HeadsOfJoints far(1, Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()));
  EXPECT_EQ(refusal(one, 1, far, turn), "the location of joint 0 in frame 0 holds a number that is not finite");
  EXPECT_EQ(refusal(far, 1, one, turn), "the end of joint 0 holds a number that is not finite");
}

TEST_F(BvhFile, CannotHoldSomeNames) {
  const std::vector<Eigen::Vector3d> one(1, Eigen::Vector3d::Zero());
  const std::vector<Eigen::Quaterniond> turn(1, Eigen::Quaterniond::Identity());
  for (const std::string name : {"", " a", "a\nb", "a{"}) {
    const BvhClip clip(std::vector<std::int32_t>{-1}, one, one, {name}, 1, one, turn);
    folder_.file("a.bvh", "old");
    EXPECT_NE(complaint([&] { write_bvh(folder_.path("a.bvh"), clip); }).find("of joint 0: it is empty, has blanks"),
              std::string::npos);
    EXPECT_EQ(folder_.bytes("a.bvh"), "old");
  }
}

TEST_F(BvhFile, AHundredThousandNestedJointsAreNoMatter) {
  std::string text = "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n", closing = "}\n", frame = "1";
  for (int j = 1; j < 100000; ++j) {
    text += "JOINT j\n{\nOFFSET 0 0 1\nCHANNELS 1 Xrotation\n";
    closing += "}\n";
    frame += " 1";
  }
  const BvhClip clip = read(text + closing + "MOTION\nFrames: 1\nFrame Time: 1\n" + frame + "\n");
  EXPECT_EQ(clip.skeleton().joint_count(), 100000);
  EXPECT_EQ(again(clip).skeleton().joint_count(), 100000);
}

}  // namespace
}  // namespace sinew
