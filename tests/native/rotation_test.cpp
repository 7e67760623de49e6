#include "rig/rotation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sinew::rig {
namespace {

constexpr float kNearest = 1.0F - 1e-4F;  // a cosine at which Blender no longer divides by the sine

Quat turned(float cosine) { return {cosine, std::sqrt(1 - cosine * cosine), 0, 0}; }

/// The first element between the unit quaternion and one with this cosine: a straight line's, or the arc's.
float on_the_line(float cosine, float t) { return (1.0F - t) + t * cosine; }

float on_the_arc(float cosine, float t) {
  const float angle = std::acos(cosine), sine = std::sin(angle);
  return std::sin((1.0F - t) * angle) / sine + std::sin(t * angle) / sine * cosine;
}

TEST(Rotation, IsBlendedOnALineOnlyWhereTheArcCannotBeTold) {
  constexpr float kShare = 0.4F;
  ASSERT_NE(on_the_line(kNearest, kShare), on_the_arc(kNearest, kShare)) << "nothing tells which it is";
  const float below = std::nextafter(kNearest, 0.0F);
  const auto blended = [](float cosine) { return slerp({1, 0, 0, 0}, turned(cosine), kShare)[0]; };
  EXPECT_EQ(blended(kNearest), on_the_line(kNearest, kShare));
  EXPECT_EQ(blended(below), on_the_arc(below, kShare));
}

}  // namespace
}  // namespace sinew::rig
