#include "rig/fcurve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "failures.h"

namespace sinew::rig {
namespace {

void set(float (&point)[2], float frame, float value) {
  point[0] = frame;
  point[1] = value;
}

CurveKey key(float frame, float value, KeyInterpolation interpolation = KeyInterpolation::linear) {
  CurveKey made;
  set(made.point, frame, value);
  set(made.left, frame - 1, value);
  set(made.right, frame + 1, value);
  made.interpolation = interpolation;
  return made;
}

CurveModifier cycles(CycleMode before, CycleMode after, int count_before = 0) {
  CurveModifier made;
  made.before = before;
  made.after = after;
  made.cycles_before = count_before;
  return made;
}

CurveModifier modifier(CurveModifier::Type type) {
  CurveModifier made;
  made.type = type;
  return made;
}

CurveModifier generator(bool is_additive, std::vector<float> coefficients) {
  CurveModifier made = modifier(CurveModifier::Type::generator);
  made.is_additive = is_additive;
  made.coefficients = std::move(coefficients);
  return made;
}

CurveDescription curve(std::vector<CurveKey> keys) { return {.keys = std::move(keys), .modifiers = {}}; }

CurveDescription ramp() { return curve({key(0, 1), key(10, 21), key(20, 5)}); }

/// The curve that Blender 5.2 evaluated for the tables below.
CurveDescription from_blender(KeyInterpolation interpolation, KeyEasing easing) {
  CurveKey first = key(0, 1.5f, interpolation), second = key(10, -2);
  set(first.left, -3, 1);
  set(first.right, 14, 3);
  set(second.left, 6, -1);
  set(second.right, 12, 0);
  first.easing = easing;
  first.amplitude = 0.8f;
  first.period = 4.1f;
  first.back = 1.70158f;
  return curve({first, second});
}

constexpr float kTimes[] = {1.25f, 4.5f, 5.5f, 9};

TEST(FCurve, HasBlendersInterpolations) {
  const struct {
    KeyInterpolation interpolation;
    KeyEasing easing;
    float values[4];
  } cases[] = {
      {KeyInterpolation::sine, KeyEasing::in, {1.43274832f, 0.661420822f, 0.27306819f, -1.45247936f}},
      {KeyInterpolation::sine, KeyEasing::out, {0.817183852f, -0.77306819f, -1.16142106f, -1.95690918f}},
      {KeyInterpolation::sine, KeyEasing::in_out, {1.3667891f, 0.0237603188f, -0.523760319f, -1.91434884f}},
      {KeyInterpolation::quadratic, KeyEasing::in, {1.4453125f, 0.79125005f, 0.441249967f, -1.3349998f}},
      {KeyInterpolation::quadratic, KeyEasing::out, {0.6796875f, -0.941249847f, -1.29125023f, -1.96499991f}},
      {KeyInterpolation::quadratic, KeyEasing::in_out, {1.390625f, 0.0825001001f, -0.582499981f, -1.93000007f}},
      {KeyInterpolation::cubic, KeyEasing::in, {1.49316406f, 1.18106246f, 0.917687476f, -1.05149984f}},
      {KeyInterpolation::cubic, KeyEasing::out, {0.344726562f, -1.41768742f, -1.68106246f, -1.99650002f}},
      {KeyInterpolation::cubic, KeyEasing::in_out, {1.47265625f, 0.224250078f, -0.724250317f, -1.98600006f}},
      {KeyInterpolation::quartic, KeyEasing::in, {1.49914551f, 1.3564781f, 1.17972803f, -0.796349764f}},
      {KeyInterpolation::quartic, KeyEasing::out, {0.0516357422f, -1.67972803f, -1.85647798f, -1.99965f}},
      {KeyInterpolation::quartic, KeyEasing::in_out, {1.49316406f, 0.351825118f, -0.851825237f, -1.99720001f}},
      {KeyInterpolation::quintic, KeyEasing::in, {1.49989319f, 1.43541515f, 1.32385039f, -0.566714764f}},
      {KeyInterpolation::quintic, KeyEasing::out, {-0.204818726f, -1.82385039f, -1.93541503f, -1.99996495f}},
      {KeyInterpolation::quintic, KeyEasing::in_out, {1.49829102f, 0.466642618f, -0.966642857f, -1.99944019f}},
      {KeyInterpolation::exponential, KeyEasing::in, {1.49528396f, 1.42600584f, 1.34859049f, -0.248288989f}},
      {KeyInterpolation::exponential, KeyEasing::out, {-0.530414104f, -1.84859037f, -1.92600584f, -1.99657869f}},
      {KeyInterpolation::exponential, KeyEasing::in_out, {1.49203372f, 0.625855505f, -1.12585533f, -1.99486804f}},
      {KeyInterpolation::circular, KeyEasing::in, {1.4725486f, 1.12559998f, 0.923076332f, -0.474385142f}},
      {KeyInterpolation::circular, KeyEasing::out, {-0.194430232f, -1.42307639f, -1.62559986f, -1.98245597f}},
      {KeyInterpolation::circular, KeyEasing::in_out, {1.44443023f, 0.512807429f, -1.01280737f, -1.964643f}},
      {KeyInterpolation::back, KeyEasing::in, {1.57458735f, 1.84435964f, 1.72838402f, -0.56910181f}},
      {KeyInterpolation::back, KeyEasing::out, {-0.225236177f, -2.22838402f, -2.3443594f, -2.05009961f}},
      {KeyInterpolation::back, KeyEasing::in_out, {1.68551993f, 0.592078686f, -1.09207869f, -2.13131523f}},
      {KeyInterpolation::bounce, KeyEasing::in, {1.36669922f, 0.625546694f, 0.866172075f, -1.73531246f}},
      {KeyInterpolation::bounce, KeyEasing::out, {1.08642578f, -1.36617208f, -1.12554669f, -1.95843744f}},
      {KeyInterpolation::bounce, KeyEasing::in_out, {1.45214844f, -0.117656231f, -0.382343769f, -1.89499998f}},
      {KeyInterpolation::elastic, KeyEasing::in, {1.49876368f, 1.50960898f, 1.47108185f, 1.48341799f}},
      {KeyInterpolation::elastic, KeyEasing::out, {-2.11369491f, -1.97108173f, -2.00960898f, -1.9994719f}},
      {KeyInterpolation::elastic, KeyEasing::in_out, {1.4989444f, 1.49170899f, -1.99170899f, -1.99851036f}},
      {KeyInterpolation::bezier, KeyEasing::automatic, {1.61580122f, 1.64305115f, 1.48791277f, -1.62008429f}},
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
       {KeyInterpolation::sine, KeyInterpolation::quadratic, KeyInterpolation::cubic, KeyInterpolation::quartic,
        KeyInterpolation::quintic, KeyInterpolation::exponential, KeyInterpolation::circular, KeyInterpolation::back,
        KeyInterpolation::bounce, KeyInterpolation::elastic}) {
    const FCurve automatic(from_blender(interpolation, KeyEasing::automatic));
    const FCurve chosen(
        from_blender(interpolation, interpolation >= KeyInterpolation::back ? KeyEasing::out : KeyEasing::in));
    EXPECT_EQ(automatic.value(4.5f), chosen.value(4.5f));
  }
}

TEST(FCurve, PassesThroughItsKeys) {
  const FCurve ramps(ramp());
  EXPECT_EQ(ramps.value(0), 1);
  EXPECT_EQ(ramps.value(5), 11);
  EXPECT_EQ(ramps.value(10), 21);
  EXPECT_EQ(ramps.value(10.00005f), 21) << "a time this near to a key is at the key";
  EXPECT_EQ(ramps.value(15), 13);
  EXPECT_EQ(FCurve(curve({key(0, 1, KeyInterpolation::constant), key(10, 2)})).value(9.5f), 1);
}

TEST(FCurve, AOneToOneLineOfBezierKeysKeepsTheTime) {
  CurveDescription data = curve({key(0, 0, KeyInterpolation::bezier), key(9, 9, KeyInterpolation::bezier)});
  set(data.keys[0].right, 3, 3);
  set(data.keys[1].left, 6, 6);
  EXPECT_NEAR(FCurve(data).value(4), 4, 1e-6);
}

TEST(FCurve, ARootThatIsKnownFromAnotherCurveIsTheSame) {
  const FCurve first(curve({key(0, 1, KeyInterpolation::bezier), key(10, 3)}));
  const FCurve alike(curve({key(0, -2, KeyInterpolation::bezier), key(10, 8)}));
  const FCurve later(curve({key(1, -2, KeyInterpolation::bezier), key(12, 8)}));
  FCurve::KnownRoot known;
  for (const float time : {2.0F, 2.0F, 7.5F}) {
    for (const FCurve* each : {&first, &alike, &later, &alike, &first}) {
      EXPECT_EQ(each->value(time, 0, &known), each->value(time));
    }
  }
}

TEST(FCurve, HandlesThatAreTooLongAreShortened) {
  CurveDescription data = curve({key(0, 0, KeyInterpolation::bezier), key(10, 1, KeyInterpolation::bezier)});
  set(data.keys[0].right, 40, 4);
  CurveDescription shortened = data;
  set(shortened.keys[0].right, 10, 1);
  for (const float time : {1.0f, 5.0f, 9.0f}) EXPECT_EQ(FCurve(data).value(time), FCurve(shortened).value(time));
}

TEST(FCurve, GoesOnBeyondItsEnds) {
  CurveDescription data = ramp();
  EXPECT_EQ(FCurve(data).value(-5), 1);
  EXPECT_EQ(FCurve(data).value(25), 5);
  data.is_extrapolated = true;
  EXPECT_EQ(FCurve(data).value(-5), -9);
  EXPECT_EQ(FCurve(data).value(25), -3);
  data.keys[0].interpolation = KeyInterpolation::bezier;
  set(data.keys[0].left, -2, 0);
  EXPECT_EQ(FCurve(data).value(-4), -1) << "a Bezier key goes on along its handle";
  data.keys[0].interpolation = KeyInterpolation::constant;
  EXPECT_EQ(FCurve(data).value(-4), 1);
  EXPECT_EQ(FCurve({{key(3, 7)}, {}, true}).value(90), 7);
}

TEST(FCurve, Cycles) {
  CurveDescription data = ramp();
  data.modifiers = {cycles(CycleMode::mirror, CycleMode::repeat_with_offset, 1)};
  const FCurve curve(data);
  EXPECT_EQ(curve.value(25), 15) << "5 frames into the cycle, 4 higher";
  EXPECT_EQ(curve.value(45), 19);
  EXPECT_EQ(curve.value(-5), 11) << "mirrored";
  EXPECT_EQ(curve.value(-25), 1) << "one cycle only, then as without";
  data.modifiers = {cycles(CycleMode::none, CycleMode::repeat)};
  EXPECT_EQ(FCurve(data).value(-5), 1);
  EXPECT_EQ(FCurve(data).value(65), 11);
  EXPECT_EQ(FCurve(data).value(40), 5) << "a cycle ends with the last key";
  EXPECT_EQ(FCurve(data).value(21), 3);
  data.modifiers = {cycles(CycleMode::none, CycleMode::mirror)};
  EXPECT_EQ(FCurve(data).value(40), 1) << "mirrored, with the first one";
  EXPECT_EQ(FCurve(data).value(60), 5);
}

TEST(FCurve, Generates) {
  CurveDescription data = ramp();
  data.modifiers = {generator(true, {1, 0, 2})};
  EXPECT_EQ(FCurve(data).value(5), 11 + 51);
  data.modifiers.push_back(generator(false, {3, 1}));
  EXPECT_EQ(FCurve(data).value(5), 8);
  data.keys.clear();
  data.modifiers = {generator(true, {1, 2})};
  EXPECT_EQ(FCurve(data).value(5, 100), 111);
  EXPECT_EQ(FCurve(CurveDescription{}).value(5, 100), 100);
}

TEST(FCurve, RoundsIntegersAndStepsChoices) {
  CurveDescription data = curve({key(0, 0), key(10, 3)});
  EXPECT_EQ(FCurve(data, ValueKind::whole).value(5), 2);
  EXPECT_EQ(FCurve(data, ValueKind::choice).value(9), 0);
  EXPECT_EQ(FCurve(data, ValueKind::boolean).value(10), 3);
  data.is_free = true;
  EXPECT_EQ(FCurve(data, ValueKind::whole).value(5), 1.5F);
  EXPECT_EQ(FCurve(data, ValueKind::choice).value(5), 1.5F);
}

TEST(FCurve, TimesThatAreNotNumbersDoNoHarm) {
  CurveDescription data = ramp();
  data.keys[0].interpolation = KeyInterpolation::bezier;
  for (const bool has_cycles : {false, true}) {
    if (has_cycles) data.modifiers = {cycles(CycleMode::mirror, CycleMode::repeat_with_offset)};
    for (const float time : {NAN, INFINITY, -INFINITY, 3e38f, -3e38f}) FCurve(data).value(time);
  }
}

TEST(StoredValue, IsWhatBlenderWouldStore) {
  EXPECT_EQ((stored_value(ValueKind::real, -1, 2, 5)), 2);
  EXPECT_EQ((stored_value(ValueKind::real, -1, 2, -5)), -1);
  EXPECT_EQ((stored_value(ValueKind::whole, -1, 2, 1.9f)), 1);
  EXPECT_EQ((stored_value(ValueKind::whole, -1, 2, 9.9f)), 2);
  EXPECT_EQ((stored_value(ValueKind::whole, -7, 7, NAN)), -7);
  EXPECT_EQ((stored_value(ValueKind::boolean, -9, 9, 0.99f)), 0);
  EXPECT_EQ((stored_value(ValueKind::boolean, -9, 9, 1)), 1);
  EXPECT_EQ((stored_value(ValueKind::choice, -9, 9, 3.9f)), 3);
}

TEST(FCurve, ChecksItsKeys) {
  CurveDescription data = ramp();
  data.keys[2].point[0] = 9;
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "Key 2 of a curve is at frame 9, before the key in front of it, at frame 10. Sort the keys by frame.");
  data = ramp();
  data.keys[1].right[1] = NAN;
  EXPECT_EQ(complaint([&] { FCurve{data}; }), "Key 1 of a curve has a number that is not finite. Give finite numbers.");
  data = ramp();
  data.modifiers = {generator(true, {1, INFINITY})};
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "A modifier of a curve has a number that is not finite. Give finite numbers.");
  data.modifiers = {generator(true, {1, 2}), cycles(CycleMode::repeat, CycleMode::repeat)};
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "The modifier Cycles of a curve is not its first one. Move it to the top, or remove it.");
  data.modifiers = {cycles(CycleMode::repeat, CycleMode::repeat)};
  data.modifiers[0].influence = 0.5F;
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "The modifier Cycles of a curve has a frame range or an influence. Remove it.");
  data.modifiers = {modifier(CurveModifier::Type::envelope)};
  data.modifiers[0].points = {{3, 0, 1}, {2, 0, 1}};
  EXPECT_EQ(complaint([&] { FCurve{data}; }),
            "The points of an Envelope of a curve are not in order. Sort them by frame.");
}

float with(const CurveModifier& modifier, float time) {
  CurveDescription data = ramp();
  data.modifiers = {modifier};
  return FCurve(data).value(time);
}

TEST(FCurve, Steps) {
  CurveModifier stepped = modifier(CurveModifier::Type::stepped);
  stepped.step = 4;
  stepped.step_offset = 1;
  EXPECT_EQ(with(stepped, 8.9F), 11);  // as on frame 5
  EXPECT_EQ(with(stepped, 9), 19);
  stepped.last_stepped = 8;
  EXPECT_EQ(with(stepped, 8.5F), 18);
  stepped.first_stepped = 6;
  EXPECT_EQ(with(stepped, 5.5F), 12);
  stepped.step = 0;
  EXPECT_TRUE(std::isnan(with(stepped, 7)) || std::isfinite(with(stepped, 7)));
}

TEST(FCurve, Limits) {
  CurveModifier limits = modifier(CurveModifier::Type::limits);
  limits.least_frame = 2;
  limits.most_value = 15;
  EXPECT_EQ(with(limits, 0), 5);
  EXPECT_EQ(with(limits, 9), 15);
  limits.most_frame = 3;
  limits.least_value = 6;
  EXPECT_EQ(with(limits, 9), 7);
  EXPECT_EQ(with(limits, 0), 6);
}

TEST(FCurve, AddsFunctions) {
  CurveModifier function = modifier(CurveModifier::Type::function);
  function.is_additive = true;
  function.phase_multiplier = 0;
  function.amplitude = 3;
  function.value_offset = 0.5F;
  const std::pair<CurveFunction, float> cases[] = {
      {CurveFunction::sine, std::sin(2.0F)},
      {CurveFunction::cosine, std::cos(2.0F)},
      {CurveFunction::tangent, std::tan(2.0F)},
      {CurveFunction::square_root, std::sqrt(2.0F)},
      {CurveFunction::natural_logarithm, std::log(2.0F)},
      {CurveFunction::normalized_sine, 0},
  };
  for (const auto& [kind, expected] : cases) {
    function.function = kind;
    function.phase_offset = 2;
    EXPECT_NEAR(with(function, 5), 11 + 3 * expected + 0.5F, 1e-5F) << static_cast<int>(kind);
  }
  for (const CurveFunction kind : {CurveFunction::square_root, CurveFunction::natural_logarithm}) {
    function.function = kind;
    function.phase_offset = -1;
    EXPECT_EQ(with(function, 5), 11);  // nothing is added where it has no value
    function.is_additive = false;
    EXPECT_EQ(with(function, 5), 0);
    function.is_additive = true;
  }
}

TEST(FCurve, TakesItsRangeToThatOfAnEnvelope) {
  CurveModifier envelope = modifier(CurveModifier::Type::envelope);
  EXPECT_EQ(with(envelope, 5), 11);  // no points
  envelope.reference = 10;
  envelope.envelope_high = 3;
  envelope.points = {{0, 0, 8}, {10, 4, 8}};
  EXPECT_EQ(with(envelope, 5), 2 + 0.5F * 6);  // 11 is halfway from 9 to 13
  EXPECT_EQ(with(envelope, 0), 0 - 2 * 8);
}

TEST(FCurve, HasModifiersOfSomeInfluenceWithinARange) {
  CurveModifier half = generator(false, {100});
  half.influence = 0.5F;
  EXPECT_EQ(with(half, 5), 0.5F * 11 + 50);
  half.has_range = true;
  half.range_start = 4;
  half.range_end = 9;
  half.blend_in = 2;
  half.blend_out = 1;
  EXPECT_EQ(with(half, 3), 7);
  EXPECT_EQ(with(half, 5), 0.75F * 11 + 25);
  EXPECT_EQ(with(half, 7), 0.5F * 15 + 50);
  EXPECT_EQ(with(half, 8.5F), 0.75F * 18 + 25);
  half.blend_in = half.blend_out = 0;
  EXPECT_EQ(with(half, 4), 0.5F * 9 + 50);  // the range has its ends
  EXPECT_EQ(with(half, 9), 0.5F * 19 + 50);
  EXPECT_EQ(with(half, std::nextafter(9.0F, 10.0F)), 1 + 2 * std::nextafter(9.0F, 10.0F));
  // Blending has its last frame, too, on which it rounds.
  half.influence = 0.9F;
  const float blended = 0.9F * 3 / 3;
  ASSERT_NE(blended, 0.9F);
  half.blend_in = 3;
  half.range_start = 2;
  EXPECT_EQ(with(half, 5), 100 * blended + 11 * (1 - blended));
  half.blend_in = 0;
  half.blend_out = 3;
  half.range_end = 8;
  EXPECT_EQ(with(half, 5), 100 * blended + 11 * (1 - blended));
  CurveModifier factors = generator(true, {1, -4, 2, 0});
  factors.is_factorised = true;
  EXPECT_EQ(with(factors, 5), 11 + 10);
}

}  // namespace
}  // namespace sinew::rig
