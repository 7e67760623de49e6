/// Rotations as Euler angles, quaternions and axis with angle, in Blender's order of operations (see vector.h).
#pragma once

#include "rig/matrix.h"

namespace sinew::rig {

/// w x y z.
struct Quat {
  float v[4];

  float& operator[](int i) { return v[i]; }
  float operator[](int i) const { return v[i]; }
};

/// In which order a bone's X, Y and Z rotations are applied; numbered as Blender numbers rotation modes.
enum class EulerOrder : signed char { xyz = 1, xzy, yxz, yzx, zxy, zyx };

// Matrices of rotations. Euler angles and quaternions are computed in double precision and rounded once.
Mat3 matrix_of(const Vec3& euler, EulerOrder order);
Mat3 matrix_of(const Quat& unit);
Mat3 axis_rotation(const Vec3& unit_axis, float angle);

inline float dot(const Quat& a, const Quat& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]; }
Quat operator*(const Quat& a, const Quat& b);

/// Half a turn about X for a quaternion of zeros.
Quat normalized(const Quat& q);

/// On the shorter way; linear where both nearly agree.
Quat slerp(const Quat& a, const Quat& b, float t);

/// None about an axis without a direction.
Quat turn_about(const Vec3& axis, float angle);

/// A vector turned by a quaternion.
Vec3 turned(const Quat& q, const Vec3& v);

/// m: unit columns. A mirroring matrix is turned over first.
Quat quaternion_of_unit(const Mat3& m);
inline Quat quaternion_of(const Mat4& m) { return quaternion_of_unit(unit_columns(upper(m))); }

/// Of the two triples of angles, that whose sum is smaller. m: unit columns.
Vec3 euler_of_unit(const Mat3& m, EulerOrder order);
inline Vec3 euler_of(const Mat4& m, EulerOrder order) { return euler_of_unit(unit_columns(upper(m)), order); }

/// Adds whole turns to `euler` so that it is near `old`.
Vec3 made_compatible(Vec3 euler, const Vec3& old);

/// Of the two triples of angles, that which is nearer to `old`.
Vec3 compatible_euler_of(const Mat4& m, EulerOrder order, const Vec3& old);

/// `euler` followed by a rotation about one axis.
Vec3 rotated_euler(const Vec3& euler, EulerOrder order, int axis, float angle);

/// The angle by which a rotation turns about an axis, and what is left without it.
struct SwingTwist {
  Quat swing;
  float twist;
};
SwingTwist swing_twist(const Quat& q, int axis);
float twist_of(const Quat& q, int axis);

}  // namespace sinew::rig
