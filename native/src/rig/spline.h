/// The curve along which a B-bone bends: a cubic Bezier, cut into pieces whose lengths follow its scale.
#pragma once

#include <span>

#include "rig/matrix.h"

namespace sinew::rig {

/// The matrix whose Y axis is `direction`, turned about it.
Mat3 matrix_of_direction(const Vec3& direction, float roll);

/// By how much a rotation turns about `direction`, compared with matrix_of_direction(direction, 0).
float roll_about(const Mat3& m, const Vec3& direction);

/// How far apart handles must be for a circle's arc, as a share of the length.
float handle_share(const Vec3& start, const Vec3& end);

/// What is given at the start and at the end of the curve.
struct SplineEnds {
  Vec3 handles[2];
  float rolls[2];
  Vec3 scales[2];
};

/// The B-bone's own uneven scale, which the curve is bent without.
struct UnevenScale {
  bool is_uneven = false;
  Mat4 to_even = kIdentity4;
  Mat4 to_uneven = kIdentity4;
};

/// Writes the matrices at the pieces' ends. segments: one more than there are pieces.
void bend_along(const SplineEnds& ends, float length, const UnevenScale& uneven, std::span<Mat4> segments);

}  // namespace sinew::rig
