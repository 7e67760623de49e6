#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "failures.h"
#include "rig_descriptions.h"

namespace sinew {
namespace {

const std::string kLocation0 = bone_path("bone", "location");
const std::string kScale0 = bone_path("bone", "scale");
const std::string kTurn = bone_path("bone", "rotation_quaternion");

/// A bone whose X a strip moves from 0 to 10 on frames 1 to 11 of action 0; action 1 leaves it at 4.
RigDescription rig_with(std::vector<std::vector<StripDescription>> tracks) {
  RigDescription rig;
  add_bone(rig, "bone", -1, {0, 0, 0});
  rig.bones[0].values[kLocation + 1] = 7;
  rig.mixed = {{kLocation0, PropertyMix::add, {0.5F, 0, 0}}, {kScale0, PropertyMix::multiply, {1, 1, 1}}};
  rig.actions = {{curve(kLocation0, 0, {{1, 0}, {11, 10}})},
                 {curve(kLocation0, 0, {{1, 4}}), curve(kScale0, 2, {{1, 3}})}};
  rig.tracks = std::move(tracks);
  return rig;
}

StripDescription clip(float start, float end, int action = 0) {
  StripDescription strip;
  strip.start = start;
  strip.end = end;
  strip.action_start = 1;
  strip.action_end = 11;
  strip.action = action;
  return strip;
}

float number_of(const RigProgram& program, const std::string& path, int index, float frame) {
  const int place = program.find_value(path).first + index;
  float number = 0;
  RigOutputs outputs;
  outputs.values = {&place, 1};
  outputs.numbers = &number;
  program.evaluate(std::array{frame}, {}, outputs);
  return number;
}

float x_of(const RigDescription& rig, float frame) { return number_of(RigProgram(rig), kLocation0, 0, frame); }

TEST(RigNla, PlaysAnActionAtItsPlace) {
  const RigDescription rig = rig_with({{clip(21, 31)}});
  EXPECT_EQ(x_of(rig, 21), 0);
  EXPECT_EQ(x_of(rig, 23.5F), 2.5F);
  EXPECT_EQ(x_of(rig, 31), 10);
  EXPECT_EQ(x_of(rig, 5), 0);  // held
  EXPECT_EQ(x_of(rig, 50), 10);
}

TEST(RigNla, SetsWhatNoStripSetsToItsDefault) {
  RigDescription rig = rig_with({{clip(21, 31), clip(41, 51, 1)}});
  for (StripDescription& strip : rig.tracks[0]) strip.extrapolation = StripExtrapolation::nothing;
  EXPECT_EQ(x_of(rig, 5), 0.5F);
  EXPECT_EQ(x_of(rig, 35), 0.5F);
  const RigProgram program(rig);
  EXPECT_EQ(number_of(program, kScale0, 2, 25), 1);  // that another one sets
  EXPECT_EQ(number_of(program, kScale0, 2, 45), 3);
  EXPECT_EQ(number_of(program, kLocation0, 1, 25), 7);  // that none sets
  EXPECT_EQ(program.keyed().size(), 2);
}

TEST(RigNla, ExtendsForward) {
  RigDescription rig = rig_with({{clip(21, 31)}});
  rig.tracks[0][0].extrapolation = StripExtrapolation::hold_forward;
  EXPECT_EQ(x_of(rig, 5), 0.5F);
  EXPECT_EQ(x_of(rig, 50), 10);
}

TEST(RigNla, ScalesRepeatsAndReverses) {
  RigDescription rig = rig_with({{clip(1, 41)}});
  StripDescription& strip = rig.tracks[0][0];
  strip.scale = 2;
  strip.repeat = 2;
  EXPECT_EQ(x_of(rig, 11), 5);
  EXPECT_EQ(x_of(rig, 31), 5);
  EXPECT_EQ(x_of(rig, 41), 10);
  strip.is_reversed = true;
  EXPECT_EQ(x_of(rig, 6), 7.5F);
  EXPECT_EQ(x_of(rig, 41), 0);
}

TEST(RigNla, BlendsStripsOfSeveralTracks) {
  const std::pair<StripBlend, float> cases[] = {
      {StripBlend::replace, 0.75F * 5 + 0.25F * 4}, {StripBlend::add, 5 + 0.25F * 4},
      {StripBlend::subtract, 5 - 0.25F * 4},        {StripBlend::multiply, 0.25F * 20 + 0.75F * 5},
      {StripBlend::combine, 5 + 0.25F * 3.5F},
  };
  for (const auto& [blend, expected] : cases) {
    RigDescription rig = rig_with({{clip(1, 11)}, {clip(1, 11, 1)}});
    rig.tracks[1][0].blend = blend;
    rig.tracks[1][0].influence = 0.25F;
    EXPECT_EQ(x_of(rig, 6), expected) << static_cast<int>(blend);
    rig.tracks[1][0].is_muted = true;
    EXPECT_EQ(x_of(rig, 6), 5);
  }
}

TEST(RigNla, CombinesScalesByTheirPowers) {
  RigDescription rig = rig_with({{clip(1, 11, 1)}, {clip(1, 11, 1)}});
  rig.tracks[1][0].blend = StripBlend::combine;
  rig.tracks[1][0].influence = 0.5F;
  EXPECT_FLOAT_EQ(number_of(RigProgram(rig), kScale0, 2, 6), 3 * std::sqrt(3.0F));
}

TEST(RigNla, CombinesRotations) {
  RigDescription rig = rig_with({});
  rig.mixed.push_back({kTurn, PropertyMix::quaternion, {1, 0, 0, 0}});
  const float half = std::sqrt(0.5F);
  rig.actions = {{curve(kTurn, 0, {{1, half}}), curve(kTurn, 3, {{1, half}})}};
  rig.tracks = {{clip(1, 11)}, {clip(1, 11)}};
  rig.tracks[1][0].blend = StripBlend::combine;
  rig.tracks[1][0].influence = 0.5F;
  const RigProgram program(rig);
  EXPECT_NEAR(number_of(program, kTurn, 0, 5), std::cos(0.375F * rig::kPi), 1e-6F);  // 135 degrees
  EXPECT_NEAR(number_of(program, kTurn, 3, 5), std::sin(0.375F * rig::kPi), 1e-6F);
  EXPECT_EQ(program.keyed().size(), 4);  // all of a quaternion
}

TEST(RigNla, FadesStripsInAndOut) {
  RigDescription rig = rig_with({{clip(1, 11, 1)}, {clip(1, 11)}});
  rig.tracks[1][0].blend_in = 4;
  rig.tracks[1][0].blend_out = 2;
  EXPECT_EQ(x_of(rig, 2), 0.75F * 4 + 0.25F * 1);
  EXPECT_EQ(x_of(rig, 6), 5);
  EXPECT_EQ(x_of(rig, 10), 0.5F * 4 + 0.5F * 9);
}

TEST(RigNla, FollowsCurvesOfInfluenceAndTime) {
  RigDescription rig = rig_with({{clip(1, 11, 1)}, {clip(1, 11)}});
  StripDescription& strip = rig.tracks[1][0];
  strip.influence = 0;
  strip.influence_curve = curve("", 0, {{1, 0}, {11, 1}}).curve;
  EXPECT_EQ(x_of(rig, 6), 0.5F * 4 + 0.5F * 5);
  strip.influence_curve = curve("", 0, {{1, 5}}).curve;  // beyond its limit
  strip.time = 0;
  strip.time_curve = curve("", 0, {{1, 11}, {11, 1}}).curve;
  EXPECT_EQ(x_of(rig, 3), 8);
  strip.is_time_cyclic = true;
  strip.time_curve = curve("", 0, {{1, 23}}).curve;
  EXPECT_EQ(x_of(rig, 3), 1);  // 22 modulo 10 is frame 2 of the action
}

TEST(RigNla, GoesFromOneStripToTheNext) {
  StripDescription transition;
  transition.type = StripType::transition;
  transition.start = 11;
  transition.end = 21;
  RigDescription rig = rig_with({{clip(1, 11), transition, clip(21, 31, 1)}});
  EXPECT_EQ(x_of(rig, 16), 0.5F * 10 + 0.5F * 4);
  EXPECT_EQ(number_of(RigProgram(rig), kScale0, 2, 16), 2);
  rig.tracks[0][1].is_reversed = true;
  EXPECT_EQ(x_of(rig, 13.5F), 0.75F * 10 + 0.25F * 4);
}

TEST(RigNla, PlaysMetaStrips) {
  StripDescription meta;
  meta.type = StripType::meta;
  meta.start = 101;
  meta.end = 131;
  meta.strips = {clip(101, 111), clip(121, 131, 1)};
  const RigDescription rig = rig_with({{meta}});
  EXPECT_EQ(x_of(rig, 106), 5);
  EXPECT_EQ(x_of(rig, 125), 4);
  EXPECT_EQ(x_of(rig, 115), 10);
}

TEST(RigNla, KeepsTheFramesOfTheActiveAction) {
  RigDescription rig = rig_with({{clip(1, 11, 1)}, {clip(5, 7)}});
  StripDescription& active = rig.tracks[1][0];
  active.keeps_frames = true;
  EXPECT_EQ(x_of(rig, 3), 2);
  active.extrapolation = StripExtrapolation::hold_forward;
  EXPECT_EQ(x_of(rig, 3), 4);
  EXPECT_EQ(x_of(rig, 9), 8);
  active.extrapolation = StripExtrapolation::nothing;
  EXPECT_EQ(x_of(rig, 9), 4);
}

TEST(RigNla, SaysWhatIsWrong) {
  const auto failure = [](const auto& change) {
    RigDescription rig = rig_with({{clip(1, 11)}});
    change(rig);
    return complaint([&] { const RigProgram program(rig); });
  };
  const auto strip = [&](const auto& change) {
    return failure([&](RigDescription& rig) { change(rig.tracks[0][0]); });
  };
  EXPECT_EQ(strip([](auto& s) { s.action = 2; }), "a strip plays action 2; the rig has 2");
  EXPECT_EQ(strip([](auto& s) { s.end = 0; }), "a strip is from frame 1 to 0; it has to end after it begins");
  EXPECT_EQ(strip([](auto& s) { s.scale = std::numeric_limits<float>::quiet_NaN(); }),
            "a strip has nan in it; expected finite numbers");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.tracks[0].push_back(clip(0, 1)); }),
            "a strip begins on frame 0, before the one in front of it; sort the strips of a track");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.mixed.pop_back(); }),
            "a strip sets " + kScale0 + ", which is not among what strips mix; describe it there");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.mixed.push_back(rig.mixed[0]); }),
            "strips set " + kLocation0 + " twice; describe it once");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.mixed[0].defaults.pop_back(); }),
            "strips set " + kLocation0 + ", which has 2 defaults; expected 3");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.mixed[0].path = "x"; }), "strips set x, which the rig does not have");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.mixed[1].mix = PropertyMix::quaternion; }),
            kScale0 + " is mixed as a quaternion and has 3 numbers; expected 4");
  EXPECT_EQ(failure([](RigDescription& rig) { rig.actions[0][0].value.index = 3; }),
            "a strip sets number 3 of " + kLocation0 + ", which has 3");
  EXPECT_EQ(failure([](RigDescription& rig) {
              StripDescription transition = clip(11, 21);
              transition.type = StripType::transition;
              StripDescription meta = clip(21, 31);
              meta.type = StripType::meta;
              rig.tracks[0].insert(rig.tracks[0].end(), {transition, meta});
            }),
            "a transition is beside a meta strip or another transition, which is not computed; ungroup the strips");
  EXPECT_EQ(strip([](StripDescription& s) {
              for (int i = 0; i < 12; ++i) {
                StripDescription meta = clip(1, 11);
                meta.type = StripType::meta;
                meta.strips = {s};
                s = meta;
              }
            }),
            "meta strips are nested more than 8 times; ungroup some");
}

TEST(RigNla, IsNotEdited) {
  const RigProgram program(rig_with({{clip(1, 11)}}));
  const AnimatedValue edited = curve(kLocation0, 0, {{1, 2}});
  EXPECT_EQ(complaint([&] {
              program.edited({}, {&edited, 1});
            }),
            kLocation0 + "[0] follows no curve; build the rig again");
}

}  // namespace
}  // namespace sinew
