#include "rig/dual_quaternion.h"

namespace sinew::rig {
namespace {

bool is_orthonormal(const Mat3& m) {
  constexpr float kTolerance = 1e-5F;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < i; ++k) {
      if (std::fabs(dot(m[i], m[k])) > kTolerance) return false;
    }
    if (std::fabs(dot(m[i], m[i]) - 1) > kTolerance) return false;
  }
  return true;
}

/// Makes the axes orthogonal, starting from Y, and keeps their lengths: Blender's older way.
void orthogonalize_keeping_sizes(Mat4& m) {
  const Vec3 sizes = sizes_of(m);
  const Vec3 y = normalized(m.axis(1)).unit;
  Vec3 x = m.axis(0);
  Vec3 z = m.axis(2);
  if (dot(y, x) < 1) {
    z = normalized(cross(x, y)).unit;
    x = cross(y, z);
  } else if (dot(x, z) < 1) {
    x = normalized(cross(y, z)).unit;
    z = cross(x, y);
  } else {
    x = normalized(cross(y, {y[1], y[2], y[0]})).unit;
    z = cross(x, y);
  }
  m.set_axis(0, x);
  m.set_axis(1, y);
  m.set_axis(2, z);
  m.scale_axes(sizes);
}

}  // namespace

DualQuaternion dual_quaternion_of(const Mat4& rest, const Mat4& m) {
  DualQuaternion result;
  const Mat4 posed = m * rest;
  const Vec3 growth = sizes_of(posed) - Vec3{1, 1, 1};
  Mat4 rigid = m;
  constexpr float kUnscaled = 1e-4F;
  if (!is_orthonormal(upper(m)) || determinant(upper(m)) < 0 || dot(growth, growth) > kUnscaled * kUnscaled) {
    Mat4 axes = posed;
    orthogonalize_keeping_sizes(axes);
    const Mat4 rotation = widened(matrix_of(quaternion_of(axes)), posed.location());
    const Mat4 inverse_rest = inverse(rest);
    rigid = rotation * inverse_rest;
    result.scale = (rest * (inverse(rotation) * posed)) * inverse_rest;
    result.scale_weight = 1;
  }
  const Quat q = quaternion_of(rigid);
  const Vec3 t = rigid.location();
  result.rotation = q;
  result.translation = {
      -0.5F * (t[0] * q[1] + t[1] * q[2] + t[2] * q[3]), 0.5F * (t[0] * q[0] + t[1] * q[3] - t[2] * q[2]),
      0.5F * (-t[0] * q[3] + t[1] * q[0] + t[2] * q[1]), 0.5F * (t[0] * q[2] - t[1] * q[1] + t[2] * q[0])};
  return result;
}

void add(DualQuaternion& sum, DualQuaternion term, float weight, const Vec3& pivot) {
  const Quat& q = term.rotation;
  if (term.scale_weight != 0) {
    const Vec3 p = transformed_point(term.scale, pivot) - pivot;
    Quat& t = term.translation;
    t[0] -= 0.5F * (q[1] * p[0] + q[2] * p[1] + q[3] * p[2]);
    t[1] += 0.5F * (q[0] * p[0] + q[2] * p[2] - q[3] * p[1]);
    t[2] += 0.5F * (q[0] * p[1] + q[3] * p[0] - q[1] * p[2]);
    t[3] += 0.5F * (q[0] * p[2] + q[1] * p[1] - q[2] * p[0]);
    term.scale.set_location(term.scale.location() - p);
  }
  const float signed_weight = dot(q, sum.rotation) < 0 ? -weight : weight;
  for (int i = 0; i < 4; ++i) {
    sum.rotation[i] += signed_weight * q[i];
    sum.translation[i] += signed_weight * term.translation[i];
  }
  if (term.scale_weight == 0) return;
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) sum.scale[i][k] += term.scale[i][k] * weight;
  }
  sum.scale_weight += weight;
}

Mat4 matrix_of(DualQuaternion sum, float total_weight) {
  const float factor = 1.0F / total_weight;
  for (int i = 0; i < 4; ++i) {
    sum.rotation[i] *= factor;
    sum.translation[i] *= factor;
  }
  if (sum.scale_weight != 0) {
    const float unscaled = total_weight - sum.scale_weight;
    for (int i = 0; i < 4; ++i) {
      if (unscaled != 0) sum.scale[i][i] += unscaled;
      for (int k = 0; k < 4; ++k) sum.scale[i][k] *= factor;
    }
  }
  const float size = std::sqrt(dot(sum.rotation, sum.rotation));
  const float inverse_size = size != 0 ? 1.0F / size : size;
  Quat q;
  for (int i = 0; i < 4; ++i) q[i] = sum.rotation[i] * inverse_size;
  const Quat& t = sum.translation;
  Mat4 m = widened(matrix_of(q));
  m[3][0] = 2.0F * (-t[0] * q[1] + t[1] * q[0] - t[2] * q[3] + t[3] * q[2]) * inverse_size;
  m[3][1] = 2.0F * (-t[0] * q[2] + t[1] * q[3] + t[2] * q[0] - t[3] * q[1]) * inverse_size;
  m[3][2] = 2.0F * (-t[0] * q[3] - t[1] * q[2] + t[2] * q[1] + t[3] * q[0]) * inverse_size;
  return sum.scale_weight != 0 ? m * sum.scale : m;
}

}  // namespace sinew::rig
