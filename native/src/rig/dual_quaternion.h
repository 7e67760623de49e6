/// Sums of transforms as dual quaternions with a scale, for Armature constraints that preserve volume.
#pragma once

#include "rig/rotation.h"

namespace sinew::rig {

/// A rotation and a location, and a scale matrix with its share of the sum.
struct DualQuaternion {
  Quat rotation = {0, 0, 0, 0};
  Quat translation = {0, 0, 0, 0};
  Mat4 scale = {};
  float scale_weight = 0;
};

/// rest  orthogonal axes in which the scale is taken off.
DualQuaternion dual_quaternion_of(const Mat4& rest, const Mat4& m);

/// Scales about `pivot`, so that only the rotation is interpolated on the sphere.
void add(DualQuaternion& sum, DualQuaternion term, float weight, const Vec3& pivot);

Mat4 matrix_of(DualQuaternion sum, float total_weight);

}  // namespace sinew::rig
