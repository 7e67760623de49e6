#include "sinew/fcurve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "failures.h"

namespace sinew {
namespace {

CurveKey key(float frame, float value, Interpolation interpolation = Interpolation::linear) {
  CurveKey made;
  made.at = {frame, value};
  made.left = {frame - 1, value};
  made.right = {frame + 1, value};
  made.interpolation = interpolation;
  return made;
}

FCurveData ramp() { return {{key(0, 1), key(10, 21), key(20, 5)}}; }

/// The curve that Blender 5.2 evaluated for the tables below.
FCurveData from_blender(Interpolation interpolation, Easing easing) {
  CurveKey first = key(0, 1.5f, interpolation), second = key(10, -2);
  first.left = {-3, 1};
  first.right = {14, 3};
  second.left = {6, -1};
  second.right = {12, 0};
  first.easing = easing;
  first.amplitude = 0.8f;
  first.period = 4.1f;
  return {{first, second}};
}

constexpr float kTimes[] = {1.25f, 4.5f, 5.5f, 9};

TEST(FCurve, HasBlendersInterpolations) {
  const struct {
    Interpolation interpolation;
    Easing easing;
    float values[4];
  } cases[] = {
      {Interpolation::sine, Easing::in, {1.43274832f, 0.661420822f, 0.27306819f, -1.45247936f}},
      {Interpolation::sine, Easing::out, {0.817183852f, -0.77306819f, -1.16142106f, -1.95690918f}},
      {Interpolation::sine, Easing::in_out, {1.3667891f, 0.0237603188f, -0.523760319f, -1.91434884f}},
      {Interpolation::quad, Easing::in, {1.4453125f, 0.79125005f, 0.441249967f, -1.3349998f}},
      {Interpolation::quad, Easing::out, {0.6796875f, -0.941249847f, -1.29125023f, -1.96499991f}},
      {Interpolation::quad, Easing::in_out, {1.390625f, 0.0825001001f, -0.582499981f, -1.93000007f}},
      {Interpolation::cubic, Easing::in, {1.49316406f, 1.18106246f, 0.917687476f, -1.05149984f}},
      {Interpolation::cubic, Easing::out, {0.344726562f, -1.41768742f, -1.68106246f, -1.99650002f}},
      {Interpolation::cubic, Easing::in_out, {1.47265625f, 0.224250078f, -0.724250317f, -1.98600006f}},
      {Interpolation::quart, Easing::in, {1.49914551f, 1.3564781f, 1.17972803f, -0.796349764f}},
      {Interpolation::quart, Easing::out, {0.0516357422f, -1.67972803f, -1.85647798f, -1.99965f}},
      {Interpolation::quart, Easing::in_out, {1.49316406f, 0.351825118f, -0.851825237f, -1.99720001f}},
      {Interpolation::quint, Easing::in, {1.49989319f, 1.43541515f, 1.32385039f, -0.566714764f}},
      {Interpolation::quint, Easing::out, {-0.204818726f, -1.82385039f, -1.93541503f, -1.99996495f}},
      {Interpolation::quint, Easing::in_out, {1.49829102f, 0.466642618f, -0.966642857f, -1.99944019f}},
      {Interpolation::expo, Easing::in, {1.49528396f, 1.42600584f, 1.34859049f, -0.248288989f}},
      {Interpolation::expo, Easing::out, {-0.530414104f, -1.84859037f, -1.92600584f, -1.99657869f}},
      {Interpolation::expo, Easing::in_out, {1.49203372f, 0.625855505f, -1.12585533f, -1.99486804f}},
      {Interpolation::circ, Easing::in, {1.4725486f, 1.12559998f, 0.923076332f, -0.474385142f}},
      {Interpolation::circ, Easing::out, {-0.194430232f, -1.42307639f, -1.62559986f, -1.98245597f}},
      {Interpolation::circ, Easing::in_out, {1.44443023f, 0.512807429f, -1.01280737f, -1.964643f}},
      {Interpolation::back, Easing::in, {1.57458735f, 1.84435964f, 1.72838402f, -0.56910181f}},
      {Interpolation::back, Easing::out, {-0.225236177f, -2.22838402f, -2.3443594f, -2.05009961f}},
      {Interpolation::back, Easing::in_out, {1.68551993f, 0.592078686f, -1.09207869f, -2.13131523f}},
      {Interpolation::bounce, Easing::in, {1.36669922f, 0.625546694f, 0.866172075f, -1.73531246f}},
      {Interpolation::bounce, Easing::out, {1.08642578f, -1.36617208f, -1.12554669f, -1.95843744f}},
      {Interpolation::bounce, Easing::in_out, {1.45214844f, -0.117656231f, -0.382343769f, -1.89499998f}},
      {Interpolation::elastic, Easing::in, {1.49876368f, 1.50960898f, 1.47108185f, 1.48341799f}},
      {Interpolation::elastic, Easing::out, {-2.11369491f, -1.97108173f, -2.00960898f, -1.9994719f}},
      {Interpolation::elastic, Easing::in_out, {1.4989444f, 1.49170899f, -1.99170899f, -1.99851036f}},
      {Interpolation::bezier, Easing::automatic, {1.61580122f, 1.64305115f, 1.48791277f, -1.62008429f}},
  };
  for (const auto& [interpolation, easing, values] : cases) {
    const FCurve curve(from_blender(interpolation, easing));
    for (int i = 0; i < 4; ++i) {
      // The C library may round the last bit differently from that of the Blender that made the table.
      EXPECT_NEAR(curve.value(kTimes[i]), values[i], 1e-6) << static_cast<int>(interpolation) << " " << kTimes[i];
    }
  }
}

TEST(FCurve, EasesByItselfAtTheUsualEnd) {
  for (const auto interpolation :
       {Interpolation::sine, Interpolation::quad, Interpolation::cubic, Interpolation::quart, Interpolation::quint,
        Interpolation::expo, Interpolation::circ, Interpolation::back, Interpolation::bounce, Interpolation::elastic}) {
    const FCurve automatic(from_blender(interpolation, Easing::automatic));
    const FCurve chosen(from_blender(interpolation, interpolation >= Interpolation::back ? Easing::out : Easing::in));
    EXPECT_EQ(automatic.value(4.5f), chosen.value(4.5f));
  }
}

TEST(FCurve, PassesThroughItsKeys) {
  const FCurve curve(ramp());
  EXPECT_EQ(curve.value(0), 1);
  EXPECT_EQ(curve.value(5), 11);
  EXPECT_EQ(curve.value(10), 21);
  EXPECT_EQ(curve.value(10.00005f), 21) << "a time this near to a key is at the key";
  EXPECT_EQ(curve.value(15), 13);
  EXPECT_EQ(FCurve({{key(0, 1, Interpolation::constant), key(10, 2)}}).value(9.5f), 1);
}

TEST(FCurve, AOneToOneLineOfBezierKeysKeepsTheTime) {
  FCurveData data{{key(0, 0, Interpolation::bezier), key(9, 9, Interpolation::bezier)}};
  data.keys[0].right = {3, 3};
  data.keys[1].left = {6, 6};
  EXPECT_NEAR(FCurve(data).value(4), 4, 1e-6);
}

TEST(FCurve, HandlesThatAreTooLongAreShortened) {
  FCurveData data{{key(0, 0, Interpolation::bezier), key(10, 1, Interpolation::bezier)}};
  data.keys[0].right = {40, 4};
  FCurveData shortened = data;
  shortened.keys[0].right = {10, 1};
  for (const float time : {1.0f, 5.0f, 9.0f}) EXPECT_EQ(FCurve(data).value(time), FCurve(shortened).value(time));
}

TEST(FCurve, GoesOnBeyondItsEnds) {
  FCurveData data = ramp();
  EXPECT_EQ(FCurve(data).value(-5), 1);
  EXPECT_EQ(FCurve(data).value(25), 5);
  data.is_linear_outside = true;
  EXPECT_EQ(FCurve(data).value(-5), -9);
  EXPECT_EQ(FCurve(data).value(25), -3);
  data.keys[0].interpolation = Interpolation::bezier;
  data.keys[0].left = {-2, 0};
  EXPECT_EQ(FCurve(data).value(-4), -1) << "a Bezier key goes on along its handle";
  data.keys[0].interpolation = Interpolation::constant;
  EXPECT_EQ(FCurve(data).value(-4), 1);
  EXPECT_EQ(FCurve({.keys = {key(3, 7)}, .is_linear_outside = true}).value(90), 7);
}

TEST(FCurve, Cycles) {
  FCurveData data = ramp();
  data.cycles = CurveCycles{CycleMode::mirror, CycleMode::repeat_with_offset, 1, 0};
  const FCurve curve(data);
  EXPECT_EQ(curve.value(25), 15) << "5 frames into the cycle, 4 higher";
  EXPECT_EQ(curve.value(45), 19);
  EXPECT_EQ(curve.value(-5), 11) << "mirrored";
  EXPECT_EQ(curve.value(-25), 1) << "one cycle only, then as without";
  data.cycles = CurveCycles{CycleMode::none, CycleMode::repeat};
  EXPECT_EQ(FCurve(data).value(-5), 1);
  EXPECT_EQ(FCurve(data).value(65), 11);
}

TEST(FCurve, Generates) {
  FCurveData data = ramp();
  data.generators = {{{1, 0, 2}, true}};
  EXPECT_EQ(FCurve(data).value(5), 11 + 51);
  data.generators.push_back({{3, 1}, false});
  EXPECT_EQ(FCurve(data).value(5), 8);
  data.keys.clear();
  data.generators = {{{1, 2}, true}};
  EXPECT_EQ(FCurve(data).value(5, 100), 111);
  EXPECT_EQ(FCurve({}).value(5, 100), 100);
}

TEST(FCurve, RoundsIntegersAndStepsChoices) {
  FCurveData data{{key(0, 0), key(10, 3)}};
  EXPECT_EQ(FCurve(data, ValueKind::integer).value(5), 2);
  EXPECT_EQ(FCurve(data, ValueKind::enumeration).value(9), 0);
  EXPECT_EQ(FCurve(data, ValueKind::boolean).value(10), 3);
}

TEST(FCurve, TimesThatAreNotNumbersDoNoHarm) {
  FCurveData data = ramp();
  data.keys[0].interpolation = Interpolation::bezier;
  for (const bool cycles : {false, true}) {
    if (cycles) data.cycles = CurveCycles{CycleMode::mirror, CycleMode::repeat_with_offset};
    for (const float time : {NAN, INFINITY, -INFINITY, 3e38f, -3e38f}) FCurve(data).value(time);
  }
}

TEST(PropertyType, HoldsWhatBlenderWouldStore) {
  EXPECT_EQ((PropertyType{ValueKind::real, -1, 2}.stored(5)), 2);
  EXPECT_EQ((PropertyType{ValueKind::real, -1, 2}.stored(-5)), -1);
  EXPECT_EQ((PropertyType{ValueKind::integer, -1, 2}.stored(1.9f)), 1);
  EXPECT_EQ((PropertyType{ValueKind::integer, -1, 2}.stored(9.9f)), 2);
  EXPECT_EQ((PropertyType{ValueKind::integer, -7, 7}.stored(NAN)), -7);
  EXPECT_EQ((PropertyType{ValueKind::boolean}.stored(0.99f)), 0);
  EXPECT_EQ((PropertyType{ValueKind::boolean}.stored(1)), 1);
  EXPECT_EQ((PropertyType{ValueKind::enumeration}.stored(3.9f)), 3);
}

TEST(FCurve, ChecksItsKeys) {
  FCurveData data = ramp();
  data.keys[2].at[0] = 9;
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "Key 2 of a curve is at frame 9, before the key in front of it, at frame 10. Sort the keys by frame.");
  data = ramp();
  data.keys[1].right[1] = NAN;
  EXPECT_EQ(complaint([&] { FCurve{data}; }), "Key 1 of a curve has a number that is not finite. Give finite numbers.");
  data = ramp();
  data.generators = {{{1, INFINITY}, true}};
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "A Generator of a curve has a coefficient that is not finite. Give finite numbers.");
}

}  // namespace
}  // namespace sinew
