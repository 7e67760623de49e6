#include "sinew/object_place.h"

#include <gtest/gtest.h>

namespace sinew {
namespace {

Matrix4<float> scaled(float x, float y, float z) { return Eigen::Vector4f(x, y, z, 1).asDiagonal(); }

Matrix4<float> moved(float x, float y, float z) {
  Matrix4<float> m = Matrix4<float>::Identity();
  m.col(3) << x, y, z, 1;
  return m;
}

TEST(ObjectPlace, AChildIsMovedByItsParentItsInverseAndItself) {
  const ObjectPlace place = place_of_child(moved(1, 2, 3), scaled(2, 2, 2), moved(1, 0, 0));
  EXPECT_EQ(place.world, moved(1, 2, 3) * scaled(2, 2, 2) * moved(1, 0, 0));
  EXPECT_EQ(place.world * place.inverse, moved(0, 0, 0));
  EXPECT_FALSE(place.is_mirrored);
}

TEST(ObjectPlace, AnOddNumberOfNegativeSizesMirrors) {
  EXPECT_TRUE(place_of(scaled(-1, 1, 1)).is_mirrored);
  EXPECT_FALSE(place_of(scaled(-1, -1, 1)).is_mirrored);
}

TEST(ObjectPlace, WithoutASizeTheInverseIsThatOfNearlyNone) {
  const ObjectPlace place = place_of(scaled(0, 1, 1));
  EXPECT_FALSE(place.has_inverse);
  EXPECT_EQ(place.inverse(0, 0), 1e8F);
  EXPECT_EQ(place.inverse(1, 1), 1);
}

TEST(ObjectPlace, WithoutAnyInverseItIsTheIdentity) {
  Matrix4<float> none = scaled(1, 1, 1);
  none(3, 3) = 0;
  EXPECT_EQ(place_of(none).inverse, scaled(1, 1, 1));
}

}  // namespace
}  // namespace sinew
