/// Rigs in files, and the example that plays one.
#include "sinew/rig_file.h"

#include <gtest/gtest.h>

#include <cmath>

#include "failures.h"
#include "files.h"

// As part of this program, so that it also runs where an emulator does.
#define main play_rig
#include "../../native/examples/play_rig.cpp"
#undef main

namespace sinew {
namespace {

const std::string kBone =
    R"({"name": "H\u00e4nd", "matrix_local": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
  "matrix": [1, 0, 0, 0, 1, 0, 0, 0, 1], "head": [0, 0, 0], "head_local": [0, 0, 0], "tail_local": [0, 1, 0],
  "length": 1, "use_inherit_rotation": false, "bbone_segments": 2})";

std::string rig_with(const std::string& entries) {
  return R"({"blender": 502, "bones": [)" + kBone + "]" + entries + "}";
}

const std::string kMoving = R"(, "curves": [{"path": "pose.bones[\"Händ\"].location", "index": 2, "keys":
  [[0, 0, 1, 0, 2, 0, 0, 0, 0, 1, 0], [2, 5, 3, 5, 4, 5, 0, 0, 0, 1, 0]]}])";

std::string said_of(const std::string& text) {
  return complaint([&] { rig_description_of(text); });
}

TEST(RigFile, EntriesAndDefaults) {
  const RigDescription rig = rig_description_of("\xEF\xBB\xBF" + rig_with(R"(, "name": "Human", "world":
    [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]], "format": 1, "properties": [{"path": "[\"a\"]", "value": -2.5e1}])"));
  EXPECT_EQ(rig.name, "Human");
  EXPECT_EQ(rig.world[13], 6);  // columns
  ASSERT_EQ(rig.bones.size(), 1);
  const BoneDescription& bone = rig.bones[0];
  EXPECT_EQ(bone.name, "Händ");
  EXPECT_TRUE(!bone.inherits_rotation && bone.deforms && !bone.has_constraints);
  EXPECT_EQ(bone.segments, 2);
  EXPECT_EQ(bone.parent, -1);
  EXPECT_EQ(bone.values[kQuaternion], 1);
  EXPECT_EQ(bone.values[kScale], 1);
  EXPECT_EQ(rig.properties[0].values, std::vector<float>{-25});
  EXPECT_EQ(rig.properties[0].high, 3.4e38F);
}

TEST(RigFile, FormatsOfTheFuture) {
  EXPECT_EQ(rig_description_of(R"({"blender": 502})").blender, 502);
  EXPECT_EQ(said_of(R"({"blender": 502, "format": 2, "muscles": []})"),
            "the rig has format 2, and this Sinew reads up to 1; use a newer one, or write the rig with this one");
  EXPECT_EQ(said_of(R"({"blender": 502, "format": 0})"), "the rig has format 0; expected 1 to 1");
  EXPECT_EQ(said_of(R"({"blender": 502, "format": 1.5})"), "the rig has 1.5 as \"format\"; expected a whole number");
}

TEST(RigFile, Mistakes) {
  EXPECT_EQ(said_of(rig_with(R"(, "name": null)")), "the rig has null as \"name\"; expected text");
  EXPECT_EQ(said_of(rig_with(R"(, "refused": [[1]])")), "the rig has 1 as \"refused\"; expected text");
  EXPECT_EQ(said_of(rig_with(R"(, "bones": [])")), "the rig has \"bones\" twice");
  EXPECT_EQ(said_of(rig_with(R"(, "values": [3])")), "a value from outside is not a dictionary");
  EXPECT_EQ(said_of(rig_with(R"(, "values": {})")), "the rig has no list as \"values\"");
  EXPECT_EQ(said_of(rig_with(R"(, "values": [{"name": "a", "value": {}}])")),
            "a value from outside has a dictionary as \"value\"; expected a number");
  EXPECT_EQ(said_of(rig_with(R"(, "world": [1, [2, true]])")), "the rig has 3 numbers as \"world\"; expected 16");
  EXPECT_EQ(said_of(rig_with(R"(, "world": [1, [], "a"])")), "the rig has \"a\" as \"world\"; expected a number");
  EXPECT_EQ(said_of(rig_with(R"(, "splines": [{"name": "s", "radii": "r", "object": {}}])")),
            "spline \"s\", a target, has 0 entries; expected one of bone, outside, armature");
  EXPECT_EQ(said_of(rig_with(R"(, "curves": [{"path": "a", "modifiers": [{"points": [1, 2]}]}])")),
            "a modifier of a curve has 2 numbers as \"points\"; expected 3 for each point");
}

TEST(RigFile, WhatIsNoJson) {
  const std::string expected = "; expected a rig as `sinew rig -o` writes it";
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"", "line 1, column 1: expected a value, found the end"},
           {"[1]", "the file holds no JSON object"},
           {"{\n  \"a\" 1}", "line 2, column 7: expected :, found \"1}\""},
           {"{1: 2}", "line 1, column 2: expected a name in quotation marks, found \"1: 2}\""},
           {"{\"a\": 1 2}", "line 1, column 9: expected , or }, found \"2}\""},
           {"{\"a\": [1,]}", "line 1, column 10: expected a value, found \"]}\""},
           {"{} {}", "line 1, column 4: expected the end, found \"{}\""},
           {"{\"a", "line 1, column 4: expected the text to end with a quotation mark, found the end"},
           {"{\"\\x\": 1}", "line 1, column 4: expected what \\ stands for, found \"x\": 1}\""},
           {"{\"\\u12g4\": 1}", "line 1, column 5: expected four hexadecimal digits, found \"12g4\": 1}\""},
           {"{\"\\ud800\": 1}", "line 1, column 9: expected the second half of a character, found \"\": 1}\""},
           {"{\"\xFF\": 1}", "the text is not UTF-8"},
       }) {
    EXPECT_EQ(said_of(text), message + expected) << text;
  }
  for (const char* number : {"01", "1.", ".5", "+1", "-", "1e", "1e+", "0x1", "- 1", "nan", "1..2"}) {
    EXPECT_NE(said_of(std::string("[") + number + "]").find("expected"), std::string::npos) << number;
    EXPECT_NE(said_of(std::string("[") + number + "]").find("line 1"), std::string::npos) << number;
  }
  const std::string inside(kMostNested, '[');
  EXPECT_NE(said_of(inside + "[").find("nested less deeply"), std::string::npos);
  EXPECT_NE(said_of(inside).find("expected a value, found the end"), std::string::npos);
}

TEST(RigFile, ValuesOfJson) {
  const Json found =
      parse_json(" [ -0.5e-1 , 1E+2,true ,[[3],[ ]],null, NaN, -Infinity, \"\\\"\\n\\u20ac\\ud83d\\ude00\" ] ");
  const Json::List& list = *found.get<Json::List>();
  ASSERT_EQ(list.size(), 8);
  EXPECT_EQ(*list[1].get<double>(), 100);
  EXPECT_EQ(list[3].get<Json::List>()->size(), 2);
  EXPECT_TRUE(list[4].get<std::monostate>());
  EXPECT_TRUE(std::isnan(*list[5].get<double>()));
  EXPECT_EQ(*list[6].get<double>(), -HUGE_VAL);
  EXPECT_EQ(*list[7].get<std::string>(), "\"\n€😀");
  EXPECT_EQ(*parse_json("[[1, 2], [false, 1e-1]]").get<std::vector<float>>(), (std::vector<float>{1, 2, 0, 0.1F}));
  EXPECT_EQ(*parse_json("0.1").get<double>(), 0.1);
}

TEST(RigFile, AnExampleInThirtyLinesPlaysIt) {
  const TemporaryFolder folder;
  const std::string path = folder.file("rig.json", rig_with(kMoving)).string();
  const auto play = [](std::vector<std::string> words) {
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    return play_rig(static_cast<int>(arguments.size()), arguments.data());
  };
  testing::internal::CaptureStdout();
  EXPECT_EQ(play({"play_rig", path, "1", "3"}), 0);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "1 Händ 0 0 0\n2 Händ 0 0 2.5\n3 Händ 0 0 5\n");
  testing::internal::CaptureStderr();
  EXPECT_EQ(play({"play_rig", folder.path("gone.json").string(), "1", "3"}), 1);
  EXPECT_EQ(play({"play_rig", folder.file("no.json", "{}").string(), "1", "3"}), 1);
  EXPECT_EQ(play({"play_rig"}), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "there is no file " + folder.path("gone.json").string() + "\n" + folder.path("no.json").string() +
                ": the rig has no \"blender\"\nusage: play_rig RIG.json FIRST_FRAME LAST_FRAME\n");
}

}  // namespace
}  // namespace sinew
