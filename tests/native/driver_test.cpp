#include "rig/driver.h"

#include <gtest/gtest.h>

namespace sinew::rig {
namespace {

constexpr float kValues[] = {3, -2, 5};

float value(DriverType type, std::span<const float> variables, CurveDescription curve = {}) {
  DriverDescription data;
  data.type = type;
  data.curve = std::move(curve);
  return Driver(data).value(variables, 0).value;
}

TEST(Driver, CombinesItsVariables) {
  EXPECT_EQ(value(DriverType::sum, kValues), 6);
  EXPECT_EQ(value(DriverType::average, kValues), 2);
  EXPECT_EQ(value(DriverType::minimum, kValues), -2);
  EXPECT_EQ(value(DriverType::maximum, kValues), 5);
  for (const DriverType type : {DriverType::sum, DriverType::average, DriverType::minimum, DriverType::maximum}) {
    EXPECT_EQ(value(type, {}), 0);
    EXPECT_EQ(value(type, std::span(kValues).first(1)), 3);
  }
}

TEST(Driver, ComputesItsExpression) {
  DriverDescription data;
  data.expression = "x * frame + y";
  data.variables.resize(2);
  data.variables[0].name = "x";
  data.variables[1].name = "y";
  EXPECT_EQ(Driver(data).value(std::span(kValues).first(2), 10).value, 28);
  data.expression = "x / 0";
  EXPECT_TRUE(Driver(data).value(kValues, 10).is_undefined);
  data.expression = "exp(1000)";
  EXPECT_EQ(Driver(data).value(kValues, 10).value, 0) << "what is not finite counts as 0";
}

TEST(Driver, ItsCurveMapsTheResult) {
  CurveKey low, high;
  low.interpolation = KeyInterpolation::linear;
  high.point[0] = 10;
  high.point[1] = 1;
  CurveModifier doubled;
  doubled.type = CurveModifier::Type::generator;
  doubled.coefficients = {0.25F, 2};
  EXPECT_EQ(value(DriverType::sum, kValues, {{low, high}, {}}), 0.6F);
  EXPECT_EQ(value(DriverType::sum, kValues, {{}, {doubled}}), 12.25F);
  doubled.is_additive = true;
  EXPECT_EQ(value(DriverType::sum, kValues, {{}, {doubled}}), 18.25F) << "without keys it adds to the driver's value";
}

TEST(TransformChannel, ReadsAMatrix) {
  const Vec3 euler{0.3F, -0.2F, 2.9F};
  Mat4 m = widened(matrix_of(euler, EulerOrder::xyz), {1, 2, 3});
  m.scale_axes({2, 2, 0.5F});
  const auto read = [&](TransformChannel channel, ChannelRotation rotation = ChannelRotation::automatic,
                        const Vec3* own = nullptr) {
    return transform_channel(m, {channel, rotation}, EulerOrder::xyz, own);
  };
  EXPECT_EQ(read(TransformChannel::location_y), 2);
  EXPECT_NEAR(read(TransformChannel::scale_z), 0.5, 1e-6);
  EXPECT_NEAR(read(TransformChannel::scale_average), std::cbrt(2), 1e-6);
  EXPECT_NEAR(read(TransformChannel::rotation_x), 0.3, 1e-6);
  EXPECT_NEAR(read(TransformChannel::rotation_z), 2.9, 1e-6);
  const Vec3 own{0.3F, -0.2F, 2.9F - 2 * kPi};
  EXPECT_NEAR(read(TransformChannel::rotation_z, ChannelRotation::automatic, &own), own[2], 1e-6);
  EXPECT_NEAR(read(TransformChannel::rotation_z, ChannelRotation::xyz, &own), 2.9, 1e-6) << "only if automatic";
  EXPECT_EQ(read(TransformChannel::rotation_w), 0) << "Euler angles have no W";
}

TEST(TransformChannel, SplitsSwingAndTwist) {
  const Mat4 m = widened(axis_rotation({0, 1, 0}, 0.8F));
  const auto read = [&](TransformChannel channel, ChannelRotation rotation) {
    return transform_channel(m, {channel, rotation}, EulerOrder::xyz, nullptr);
  };
  EXPECT_NEAR(read(TransformChannel::rotation_y, ChannelRotation::swing_twist_y), 0.8, 1e-6);
  EXPECT_NEAR(read(TransformChannel::rotation_w, ChannelRotation::swing_twist_y), 0, 1e-3) << "no swing";
  EXPECT_NEAR(read(TransformChannel::rotation_y, ChannelRotation::swing_twist_x), 0.8, 1e-6) << "all swing";
  EXPECT_NEAR(read(TransformChannel::rotation_w, ChannelRotation::swing_twist_x), 0.8, 1e-6);
  EXPECT_NEAR(read(TransformChannel::rotation_w, ChannelRotation::quaternion), std::cos(0.4), 1e-6);
  EXPECT_NEAR(read(TransformChannel::rotation_y, ChannelRotation::quaternion), std::sin(0.4), 1e-6);
}

TEST(RotationDifference, IsTheSmallerAngle) {
  const Mat4 a = widened(axis_rotation({0, 0, 1}, 3)), b = widened(axis_rotation({0, 0, 1}, -3));
  EXPECT_NEAR(rotation_difference(a, kIdentity4), 3, 1e-6);
  EXPECT_NEAR(rotation_difference(a, b), 2 * kPi - 6, 1e-6);
}

}  // namespace
}  // namespace sinew::rig
